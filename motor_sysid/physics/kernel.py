"""The time loop: exact linear core, implicit second-order exponential steps for effects.

One sample of length ``h`` under a held input ``u`` advances

    dx/dt = A x + B u + G f(x, u, z)

by ``a = E x + h phi1(Ah) (B u + G f0)`` and ``x' = a + h phi2(Ah) G (f1 - f0)``, where
``E = exp(Ah)``, ``f0 = f(x)``, and ``f1`` is the force at the end of the step: at ``a``, but for
laws that are stiff in the one state of their own (speed for torque, current for voltage), whose
force is taken at the new value of that state.  Where the old force of such a law would still turn
the new one by more than a quarter, phi1 takes the place of phi2 for it: the trapezoid would ring,
the implicit Euler step does not.  The linear motor is exact for any time constant.
(Cox and Matthews 2002, doi:10.1006/jcph.2002.6995, for exponential time differencing; Hairer and
Wanner, Solving Ordinary Differential Equations II, 1996, section IV.3, for stiff decay.)

A stiff law that turns within a step (the sign of a friction, and then sticking) does so at some
moment in it, which one step does not see: that error falls with the length of the step, whatever
the order of the method.  That step is then taken again in finer ones.  How much these count in a
lane grows steadily with how far its laws have turned, so that differences between lanes stay
smooth.

What happens at once (the rotor passes an angle at which the drive commutates) is added to the
state at the end of the step in which it happens.

An input delay of k samples and a fraction f cuts each sample in two pieces of its own length in
every lane: f under the older input, the rest under the newer one.  That is exact, too.  Each piece
may be cut further in parts that grow with the time since the input changed.

The kernel works on blocks of 32 parameter vectors; the last axis of every array is the lane.
"""

from numba import njit
import numpy as np

from motor_sysid.physics.buffer import (
    add_jumps,
    add_push,
    begin_step,
    blend,
    call_all,
    clear,
    confine,
    copy,
    evaluate_rates,
    hold_input,
    keep,
    load_state,
    positive,
    put,
    remember,
    swap,
)
from motor_sysid.physics.effect import ARGUMENTS
from motor_sysid.physics.implicit import (
    HARD_ROW,
    JUMP,
    KEPT_ROWS,
    mark_turned,
    prepare,
    ROWS,
    secants,
    settle,
)
from motor_sysid.physics.native import as_pointer, LANES, new_row, new_rows, on_stack
from motor_sysid.physics.own_states import add_rate_laws, correct_own, predict_own
from motor_sysid.physics.readings import hold_shown, shares, show
from motor_sysid.physics.track import follow, meet

CHUNK = 3
"""Products that are summed at a time."""

OMEGA, THETA = ARGUMENTS.index('omega'), ARGUMENTS.index('theta')


@njit(cache=True, nogil=True, error_model='numpy')
def run_block(  # type: ignore[no-untyped-def]
    whole, phi1_force, phi2_force, width, wide, coarse, substeps, dt, t0, first, count,
    inputs, late, position, half, places, push, buffer, base, state,
    state_rows, input_rows, force_rows, own_state, time_row,
    lane_calls, stiff_count, stiff_force, rate_calls, memory_offset, memory_rate, memory_fades,
    linear, slope_calls, slope_force, slope_rows, sensor_calls,
    jump_calls, jump_state, jump_rows,
    output_state, output_rate, output_bias, output_sensor, output_filter, outputs,
):  # fmt: skip
    """Simulate one block and write its outputs.

    Parameters
    ----------
    whole:
        (S, n, K, W) matrices of one step in each of the pieces of a sample, the first half of them
        under the older input where there is an input delay, and of the finer steps in place of
        one step of the first piece, the second, ...: E, h phi1 B and h phi1 G side by side, filled
        up with zeros to K columns, a multiple of `CHUNK`.
    phi1_force, phi2_force:
        (S, n, m, W) matrices h phi1 G and h phi2 G.
    width:
        (S, W) length of a step in s.
    wide:
        Lanes that are used, at most W; the others are left alone.
    coarse:
        How many pieces a sample is made of; what follows are finer steps, which are taken where a
        stiff law turns within a step.  Without them no step is taken again.
    substeps, dt, t0:
        Steps per piece, sample time in s, and (W,) time of each lane's first row of inputs in s.
    first, count:
        Row to begin at, and row to end before.
    inputs:
        (N, n_u) held inputs.
    late:
        (W,) whole samples that the input is late by.
    position:
        (N,) or (N + 1,) measured position for laws that depend on it, or empty.
    half:
        Half the width of its counts, rad; the simulated position counts within them.
    places:
        (3, W) where each lane has rows of its own: its first one, and the lowest and one past the
        highest that it may see; or (3, 0).
    push:
        (N, 2, m, W) forces from outside at the start and at the end of each sample, between which
        they change linearly; or empty.
    buffer, base:
        Flat work memory and its address; rows are described in `motor_sysid.physics.lanes`, the
        last `KEPT_ROWS` of them in `motor_sysid.physics.implicit`.
    state:
        (n, W) core state, advanced in place.
    lane_calls, rate_calls, slope_calls, sensor_calls:
        (K, 3) addresses of laws, offsets of their own parameters and of their own states.
    memory_fades:
        For each own state whether its rate depends on itself.
    jump_calls, jump_state, jump_rows:
        Laws that move states at once at the end of a step, these states, and the rows of what is
        added to them.
    linear, slope_calls, ...:
        The linear motor, and laws that read the rate of change of their own equation; see
        `motor_sysid.physics.own_states.add_rate_laws`.
    output_state, output_rate, output_bias, output_sensor, output_filter:
        What sensors show; see `motor_sysid.physics.readings`.
    outputs:
        (N - first, n_y, W) model outputs at the sample times.
    """
    pieces, n, m, n_u = whole.shape[0], whole.shape[1], phi1_force.shape[2], inputs.shape[1]
    fine = pieces // coarse - 1
    n_lanes, n_slopes = lane_calls.shape[0], slope_calls.shape[0]
    n_memory, n_jumps = memory_offset.shape[0], jump_calls.shape[0]
    p = as_pointer(base)  # type: ignore[var-annotated]
    predicted, previous, rough, old = new_rows(n), new_rows(n), new_rows(n), new_rows(n)
    begun, start, ended = new_rows(m), new_rows(m), new_rows(m)
    secant, jump, share = new_rows(m), new_rows(m), new_rows(m)
    old_memory, old_rate, next_memory = new_rows(n_memory), new_rows(n_memory), new_rows(n_memory)
    kept, all_in, work = new_rows(n_memory), new_rows(whole.shape[2]), new_rows(3)
    now, h, begins, since, share_in = new_row(), new_row(), new_row(), new_row(), new_row()
    here, there, passed, turned = new_row(), new_row(), new_row(), new_row()
    x, u, before = all_in[:n], all_in[n : n + n_u], all_in[n + n_u : n + n_u + m]
    w = on_stack(ROWS * LANES)
    most = as_pointer(base + 8 * (buffer.shape[0] - KEPT_ROWS * LANES))
    all_in[:], secant[:], jump[:], share[:] = 0.0, 0.0, 0.0, 0.0
    x[:] = state
    previous[:] = state
    answers = np.zeros(m, dtype=np.bool_)
    for i in range(stiff_count):
        answers[stiff_force[i]] = True
    follows, pushed = position.shape[0] > 0, push.shape[0] > 0
    position_row = speed_row = -1
    for j in range(n):
        if state_rows[j] == OMEGA:
            speed_row = j
        elif state_rows[j] == THETA:
            position_row = j
    half = half if position_row >= 0 else 0.0
    if position_row >= 0 and speed_row >= 0:
        for k in range(wide):  # before the first sample: as if the speed had been held
            previous[position_row, k] -= dt * x[speed_row, k]
    time_at = time_row * LANES
    filters = shares(wide, p, output_filter, dt, share_in)

    for sample in range(first, count):
        for k in range(wide):
            begins[k] = t0[k] + sample * dt
        if sensor_calls.shape[0] > 0:
            if follows:
                meet(wide, position, places, sample, here)
            for k in range(wide):
                p[time_at + k] = begins[k]
            load_state(wide, p, x, state_rows, position_row, speed_row, follows, here, half, h)
            clear(wide, p, output_sensor)
            call_all(wide, base, sensor_calls, 0, sensor_calls.shape[0])
        show(
            wide, p, x, previous, 1.0 / dt, output_state, output_rate, output_bias, output_sensor,
            output_filter, share_in, sensor_calls.shape[0] > 0, outputs, sample - first,
        )  # fmt: skip
        if follows and half > 0.0:
            meet(wide, position, places, sample, here)
            confine(wide, x[position_row], here, half)
        copy(wide, x, previous)
        for k in range(wide):
            now[k] = begins[k]
        step, finer = 0, 0  # the finer ones are counted from 1
        while step < coarse * substeps:
            part = step // substeps
            piece = part if finer == 0 else coarse + part * fine + finer - 1
            if fine > 0 and finer == 0:
                remember(wide, p, memory_offset, kept)
                copy(wide, x, old)
                for k in range(wide):
                    since[k], turned[k] = now[k], 0.0
            delayed = late.shape[0] > 0 and part < coarse // 2
            hold_input(wide, u, inputs, late, places, sample - (1 if delayed else 0))
            if n_lanes + n_slopes + n_memory + n_jumps == 0 and not pushed:
                predict(wide, predicted, whole, piece, all_in)
                copy(wide, predicted, x)
                step += 1
                continue
            for j in range(n_u):
                row = input_rows[j] * LANES
                for k in range(wide):
                    p[row + k] = u[j, k]
            for k in range(wide):
                h[k] = width[piece, k]
                p[time_at + k] = now[k]
            if follows:
                for k in range(wide):
                    passed[k] = (now[k] - begins[k]) / dt
                follow(wide, position, places, sample, passed, here)
                for k in range(wide):
                    passed[k] += h[k] / dt
                follow(wide, position, places, sample, passed, there)

            if n_jumps > 0:
                begin_step(wide, p, x, position_row, follows, here, half, h)

            # stage 0: every law at the state
            load_state(wide, p, x, state_rows, position_row, speed_row, follows, here, half, h)
            clear(wide, p, force_rows)
            call_all(wide, base, lane_calls, 0, stiff_count)
            keep(wide, begun, p, force_rows)
            call_all(wide, base, lane_calls, stiff_count, n_lanes)
            if pushed:
                add_push(wide, p, force_rows, push, sample, now, begins, dt)
            if n_slopes > 0:
                add_rate_laws(
                    wide, p, base, x, u, linear, slope_calls, slope_force, slope_rows,
                    force_rows, own_state, work,
                )  # fmt: skip
            keep(wide, before, p, force_rows)
            if n_memory > 0:
                evaluate_rates(wide, p, base, rate_calls, memory_rate)
                predict_own(
                    wide, p, base, rate_calls, memory_fades, memory_offset, memory_rate, h,
                    old_memory, old_rate, next_memory, work,
                )  # fmt: skip

            # predictor
            predict(wide, predicted, whole, piece, all_in)
            for k in range(wide):
                now[k] += h[k]

            # stage 2: stiff laws with only their own state moved
            if stiff_count > 0:
                put(wide, p, memory_offset, old_memory)
                secants(
                    wide, p, base, lane_calls, stiff_count, stiff_force, answers, state_rows,
                    force_rows, own_state, x, predicted, begun, secant,
                )  # fmt: skip
                put(wide, p, memory_offset, next_memory)

            # stage 1: every law at the predicted state
            load_state(
                wide, p, predicted, state_rows, position_row, speed_row, follows, there, half, h
            )
            if n_memory > 0:
                evaluate_rates(wide, p, base, rate_calls, memory_rate)
                correct_own(
                    wide, p, base, rate_calls, memory_fades, memory_offset, memory_rate, h,
                    old_memory, old_rate, work,
                )  # fmt: skip
            clear(wide, p, force_rows)
            call_all(wide, base, lane_calls, 0, stiff_count)
            keep(wide, start, p, force_rows)
            call_all(wide, base, lane_calls, stiff_count, n_lanes)
            if pushed:
                add_push(wide, p, force_rows, push, sample, now, begins, dt)
            if n_slopes > 0:
                add_rate_laws(
                    wide, p, base, predicted, u, linear, slope_calls, slope_force, slope_rows,
                    force_rows, own_state, work,
                )  # fmt: skip

            # corrector: stiff laws at the end of the step, the others by the trapezoid
            for j in range(m):
                row = force_rows[j] * LANES
                for k in range(wide):
                    ended[j, k] = p[row + k] - before[j, k]
            hard = 0
            for j in range(m):
                if not answers[j]:
                    continue
                hard += prepare(
                    wide, w, j, own_state[j], predicted, ended, begun, start, secant,
                    phi1_force, phi2_force, piece,
                )  # fmt: skip
                own = own_state[j]
                row = state_rows[own] * LANES
                settle(
                    wide, p, base, lane_calls, stiff_count, stiff_force, j, row,
                    force_rows[j] * LANES, w,
                )  # fmt: skip
                for k in range(wide):
                    jump[j, k], share[j, k] = w[JUMP + k], w[HARD_ROW + k]
                    p[row + k] = predicted[own, k]
                if fine > 0 and finer == 0:
                    mark_turned(wide, w, most, j, begun, own, predicted, turned)
            for j in range(m):
                if answers[j]:
                    for k in range(wide):
                        ended[j, k] += jump[j, k] - (start[j, k] - begun[j, k])
            correct(wide, x, predicted, phi2_force, piece, ended)
            if hard > 0:
                push_late(wide, x, phi1_force, phi2_force, piece, share, jump)
            if n_jumps > 0:
                load_state(
                    wide, p, x, state_rows, position_row, speed_row, follows, there, half, h
                )
                add_jumps(
                    wide, p, base, x, jump_calls, jump_state, jump_rows, lane_calls, n_lanes,
                    force_rows, secant,
                )  # fmt: skip
            if fine > 0 and finer == 0 and positive(wide, turned) > 0:
                copy(wide, x, rough)
                copy(wide, old, x)
                swap(wide, p, memory_offset, kept)
                for k in range(wide):
                    now[k] = since[k]
                finer = 1
                continue
            if finer > 0:
                finer += 1
                if finer <= fine:
                    continue
                blend(wide, x, rough, p, memory_offset, kept, turned)
            step, finer = step + 1, 0
    if filters:
        hold_shown(wide, x, previous, output_filter)
    state[:] = x


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def predict(wide, predicted, whole, piece, all_in):  # type: ignore[no-untyped-def]
    """Set `predicted` (n, W) to where state, input and force lead; three products at a time."""
    for j in range(predicted.shape[0]):
        for k in range(wide):
            part = whole[piece, j, 1, k] * all_in[1, k] + whole[piece, j, 2, k] * all_in[2, k]
            predicted[j, k] = whole[piece, j, 0, k] * all_in[0, k] + part
        for i in range(CHUNK, all_in.shape[0], CHUNK):
            for k in range(wide):
                part = whole[piece, j, i + 1, k] * all_in[i + 1, k]
                part += whole[piece, j, i + 2, k] * all_in[i + 2, k]
                predicted[j, k] += whole[piece, j, i, k] * all_in[i, k] + part


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def correct(wide, x, predicted, phi2_force, piece, change):  # type: ignore[no-untyped-def]
    """Set the state to the predicted one and what the (m, W) changes of the forces add."""
    for j in range(x.shape[0]):
        for k in range(wide):
            x[j, k] = predicted[j, k] + phi2_force[piece, j, 0, k] * change[0, k]
        for i in range(1, change.shape[0]):
            for k in range(wide):
                x[j, k] += phi2_force[piece, j, i, k] * change[i, k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def push_late(wide, x, phi1_force, phi2_force, piece, share, jump):  # type: ignore[no-untyped-def]
    """Let the changes of stiff laws act over the whole of the step in the lanes that are hard."""
    for j in range(x.shape[0]):
        for i in range(jump.shape[0]):
            for k in range(wide):
                more = phi1_force[piece, j, i, k] - phi2_force[piece, j, i, k]
                x[j, k] += share[i, k] * more * jump[i, k]
