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

The kernel takes blocks of 32 parameter vectors; the last axis of every array is the lane.  It runs
eight lanes at a time through the whole of the data, each number of theirs a `vector`.
"""

from motor_sysid.physics.buffer import (
    add_jumps,
    add_push,
    begin_step,
    blend,
    call_all,
    clear,
    copy,
    evaluate_rates,
    hold_input,
    keep,
    load_state,
    remember,
    restore,
    swap,
    within,
)
from motor_sysid.physics.effect import ARGUMENTS
from motor_sysid.physics.exponential import CHUNK
from motor_sysid.physics.implicit import has_turned, KEPT_ROWS, secants, settle, weighed
from motor_sysid.physics.native import as_pointer, behind, compiled, data_of, inlined, LANES, rows
from motor_sysid.physics.own_states import add_rate_laws, correct_own, predict_own
from motor_sysid.physics.readings import hold_shown, share_of, show
from motor_sysid.physics.summed import straightened
from motor_sysid.physics.track import at_share, curve
from motor_sysid.physics.vector import get, put, some, spread, where, WIDTH

OMEGA, THETA = ARGUMENTS.index('omega'), ARGUMENTS.index('theta')


@compiled
def run_block(  # type: ignore[no-untyped-def]
    whole, phi1_force, phi2_force, width, wide, coarse, substeps, dt, t0, first, count,
    inputs, late, position, half, places, push, buffer, first_base, state,
    state_rows, input_rows, force_rows, own_state, time_row,
    lane_calls, stiff_count, stiff_force, rate_calls, memory_offset, memory_rate, memory_fades,
    linear, slope_calls, slope_force, slope_rows, sensor_calls, sum_calls, sum_lag,
    jump_calls, jump_state, jump_rows,
    output_state, output_rate, output_bias, output_sensor, output_filter, outputs,
):  # fmt: skip
    """Simulate one block and write its outputs.

    Parameters
    ----------
    whole:
        (V, S, n, K, 8) matrices of one step of each vector of lanes, in each of the pieces of a
        sample, the first half of them under the older input where there is an input delay, and of
        the finer steps in place of one step of the first piece, the second, ...: E, h phi1 B and
        h phi1 G side by side, filled up with zeros to K columns, a multiple of `CHUNK`.
    phi1_force, phi2_force:
        (V, S, n, m, 8) matrices h phi1 G and h phi2 G.
    width:
        (S, W) length of a step in s.
    wide:
        Lanes that are used, in whole vectors, at most W; the others are left alone.
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
    buffer, first_base:
        Flat work memory and its address; rows are described in `motor_sysid.physics.lanes`, the
        last `KEPT_ROWS` of them in `motor_sysid.physics.implicit`.
    state:
        (n, W) core state, advanced in place.
    lane_calls, rate_calls, slope_calls, sensor_calls:
        (K, 3) addresses of laws, offsets of their own parameters and of their own states.
    memory_fades:
        For each own state whether its rate depends on itself.
    sum_calls, sum_lag:
        What the followed position, if it is the sum of a speed, has beyond the angle; see
        `motor_sysid.physics.summed`.
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
    pieces, n, m, n_u = whole.shape[1], whole.shape[2], phi1_force.shape[3], inputs.shape[1]
    columns, fine, n_y = whole.shape[3], pieces // coarse - 1, output_state.shape[0]
    n_lanes, n_slopes, n_sensors = lane_calls.shape[0], slope_calls.shape[0], sensor_calls.shape[0]
    n_memory, n_jumps = memory_offset.shape[0], jump_calls.shape[0]
    follows, pushed = position.shape[0] > 0, push.shape[0] > 0
    summed = follows and (sum_calls.shape[0] > 0 or sum_lag >= 0)
    none = n_lanes + n_slopes + n_memory + n_jumps == 0 and not pushed
    all_in, predicted, previous, rough, old = rows(columns), rows(n), rows(n), rows(n), rows(n)
    begun, start, ended = rows(m), rows(m), rows(m)
    secant, jump, share, answers = rows(m), rows(m), rows(m), rows(m)
    old_memory, old_rate, next_memory = rows(n_memory), rows(n_memory), rows(n_memory)
    kept = rows(n_memory)
    x, u, before = all_in, behind(all_in, n * WIDTH), behind(all_in, (n + n_u) * WIDTH)
    for j in range(m):
        answers[j] = 0.0
    for i in range(stiff_count):
        answers[stiff_force[i]] = 1.0
    position_row = speed_row = -1
    for j in range(n):
        if state_rows[j] == OMEGA:
            speed_row = j
        elif state_rows[j] == THETA:
            position_row = j
    half = half if position_row >= 0 else 0.0
    time_at = time_row * LANES

    for lane in range(0, wide, WIDTH):
        base = first_base + 8 * lane
        p = as_pointer(base)
        most = behind(p, buffer.shape[0] - KEPT_ROWS * LANES)
        moves = behind(data_of(whole), lane * pieces * n * columns)
        phi1 = behind(data_of(phi1_force), lane * pieces * n * m)
        phi2 = behind(data_of(phi2_force), lane * pieces * n * m)
        lengths = behind(data_of(width), lane)
        out, pushes = behind(data_of(outputs), lane), behind(data_of(push), lane)
        core = (
            behind(data_of(linear[0]), lane * n * n), behind(data_of(linear[1]), lane * n * n_u),
            behind(data_of(linear[2]), lane * n * m),
        )  # fmt: skip
        zero = get(data_of(t0), lane)
        for j in range(columns):
            put(all_in, j * WIDTH, spread(0.0))
        for j in range(m):
            put(secant, j * WIDTH, spread(0.0))
            put(jump, j * WIDTH, spread(0.0))
            put(share, j * WIDTH, spread(0.0))
        for j in range(n):
            for k in range(WIDTH):
                x[j * WIDTH + k] = state[j, lane + k]
        copy(n, x, previous)
        if position_row >= 0 and speed_row >= 0:
            # before the first sample: as if the speed had been held
            at = position_row * WIDTH
            put(previous, at, get(previous, at) - dt * get(x, speed_row * WIDTH))
        h = here = there = since = turned = spread(0.0)
        way = h, h, h, h
        filters, share_in = share_of(p, output_filter, dt)

        for sample in range(first, count):
            begins = zero + sample * dt
            if follows:
                way = curve(position, places, lane, sample)
                if summed:
                    way = straightened(p, base, sum_calls, sum_lag, way, dt, begins)
                here = way[0]
            if n_sensors > 0:
                put(p, time_at, begins)
                load_state(p, x, state_rows, position_row, speed_row, follows, here, half, h)
                clear(p, output_sensor)
                call_all(base, sensor_calls, 0, n_sensors)
            show(
                p, x, previous, 1.0 / dt, output_state, output_rate, output_bias, output_sensor,
                output_filter, share_in, n_sensors > 0, out, (sample - first) * n_y * LANES,
            )  # fmt: skip
            if follows and half > 0.0:
                at = position_row * WIDTH
                put(x, at, within(get(x, at), here, half))
            copy(n, x, previous)
            now = begins
            part, step, finer, held = 0, 0, 0, sample + 1  # the finer ones are counted from 1
            while part < coarse:
                piece = part if finer == 0 else coarse + part * fine + finer - 1
                if fine > 0 and finer == 0:
                    remember(p, memory_offset, kept)
                    copy(n, x, old)
                    since, turned = now, spread(0.0)
                wanted = sample - (1 if late.shape[0] > 0 and part < coarse // 2 else 0)
                if wanted != held:
                    hold_input(u, inputs, late, places, lane, wanted)
                    for j in range(n_u):
                        put(p, input_rows[j] * LANES, get(u, j * WIDTH))
                    held = wanted
                move = piece * n * columns * WIDTH
                if none:
                    predict(n, columns, predicted, behind(moves, move), all_in)
                    copy(n, predicted, x)
                    part, step = (part, step + 1) if step + 1 < substeps else (part + 1, 0)
                    continue
                h = get(lengths, piece * LANES)
                put(p, time_at, now)
                if follows:
                    passed = (now - begins) / dt
                    here, there = at_share(passed, way), at_share(passed + h / dt, way)
                if n_jumps > 0:
                    begin_step(p, x, position_row, follows, here, half, h)

                # stage 0: every law at the state
                load_state(p, x, state_rows, position_row, speed_row, follows, here, half, h)
                clear(p, force_rows)
                call_all(base, lane_calls, 0, stiff_count)
                keep(begun, p, force_rows)
                call_all(base, lane_calls, stiff_count, n_lanes)
                if pushed:
                    at = sample * 2 * m * LANES
                    add_push(p, force_rows, pushes, at, (now - begins) / dt)
                if n_slopes > 0:
                    add_rate_laws(
                        p, base, x, u, (n, n_u), core, slope_calls, slope_force, slope_rows,
                        force_rows, own_state,
                    )  # fmt: skip
                keep(before, p, force_rows)
                if n_memory > 0:
                    evaluate_rates(p, base, rate_calls, memory_rate)
                    predict_own(
                        p, base, rate_calls, memory_fades, memory_offset, memory_rate, h,
                        old_memory, old_rate, next_memory,
                    )  # fmt: skip

                predict(n, columns, predicted, behind(moves, move), all_in)
                now = now + h

                # stage 2: stiff laws with only their own state moved
                if stiff_count > 0:
                    restore(p, memory_offset, old_memory)
                    secants(
                        p, base, lane_calls, stiff_count, stiff_force, answers, state_rows,
                        force_rows, own_state, x, predicted, begun, secant,
                    )  # fmt: skip
                    restore(p, memory_offset, next_memory)

                # stage 1: every law at the predicted state
                load_state(
                    p, predicted, state_rows, position_row, speed_row, follows, there, half, h
                )
                if n_memory > 0:
                    evaluate_rates(p, base, rate_calls, memory_rate)
                    correct_own(
                        p, base, rate_calls, memory_fades, memory_offset, memory_rate, h,
                        old_memory, old_rate,
                    )  # fmt: skip
                clear(p, force_rows)
                call_all(base, lane_calls, 0, stiff_count)
                keep(start, p, force_rows)
                call_all(base, lane_calls, stiff_count, n_lanes)
                if pushed:
                    at = sample * 2 * m * LANES
                    add_push(p, force_rows, pushes, at, (now - begins) / dt)
                if n_slopes > 0:
                    add_rate_laws(
                        p, base, predicted, u, (n, n_u), core, slope_calls, slope_force,
                        slope_rows, force_rows, own_state,
                    )  # fmt: skip

                # corrector: stiff laws at the end of the step, the others by the trapezoid
                for j in range(m):
                    force = get(p, force_rows[j] * LANES)
                    put(ended, j * WIDTH, force - get(before, j * WIDTH))
                pushes_late = False
                for j in range(m):
                    if answers[j] == 0.0:
                        continue
                    own, at = own_state[j], (piece * n + own_state[j]) * m * WIDTH
                    old_law, new_law = get(begun, j * WIDTH), get(start, j * WIDTH)
                    ahead, row = get(predicted, own * WIDTH), state_rows[own] * LANES
                    change = get(phi2, at) * get(ended, 0)
                    for i in range(1, m):
                        change = change + get(phi2, at + i * WIDTH) * get(ended, i * WIDTH)
                    rises = get(phi2, at + j * WIDTH)
                    hard, weight, c, d = weighed(
                        change, new_law - old_law, get(secant, j * WIDTH),
                        get(phi1, at + j * WIDTH), rises,
                    )  # fmt: skip
                    law = settle(
                        p, base, lane_calls, stiff_count, stiff_force, j, row,
                        force_rows[j] * LANES, ahead, new_law, weight, c, d,
                    )  # fmt: skip
                    put(p, row, ahead)
                    put(jump, j * WIDTH, law - old_law)
                    put(share, j * WIDTH, where(hard, 1.0, 0.0))
                    pushes_late = pushes_late or some(hard)
                    if fine > 0 and finer == 0:
                        turn = has_turned(most, j, old_law, law - old_law, rises, ahead)
                        turned = max(turned, turn)
                for j in range(m):
                    if answers[j] != 0.0:
                        at = j * WIDTH
                        more = get(jump, at) - (get(start, at) - get(begun, at))
                        put(ended, at, get(ended, at) + more)
                at = piece * n * m * WIDTH
                correct(n, m, x, predicted, behind(phi2, at), ended)
                if pushes_late:
                    push_late(n, m, x, behind(phi1, at), behind(phi2, at), share, jump)
                if n_jumps > 0:
                    load_state(p, x, state_rows, position_row, speed_row, follows, there, half, h)
                    add_jumps(
                        p, base, x, jump_calls, jump_state, jump_rows, lane_calls, n_lanes,
                        force_rows, secant,
                    )  # fmt: skip
                if fine > 0 and finer == 0 and some(turned > 0.0):
                    copy(n, x, rough)
                    copy(n, old, x)
                    swap(p, memory_offset, kept)
                    now, finer = since, 1
                    continue
                if finer > 0:
                    finer += 1
                    if finer <= fine:
                        continue
                    blend(n, x, rough, p, memory_offset, kept, turned)
                part, step = (part, step + 1) if step + 1 < substeps else (part + 1, 0)
                finer = 0
        if filters:
            hold_shown(x, previous, output_filter)
        for j in range(n):
            for k in range(WIDTH):
                state[j, lane + k] = x[j * WIDTH + k]


@inlined
def predict(n, columns, predicted, moves, all_in):  # type: ignore[no-untyped-def]
    """Set `predicted` to where state, input and force lead; three products at a time."""
    for j in range(n):
        total = spread(0.0)
        for i in range(0, columns, CHUNK):
            at, row = i * WIDTH, (j * columns + i) * WIDTH
            part = get(moves, row + WIDTH) * get(all_in, at + WIDTH)
            part = part + get(moves, row + 2 * WIDTH) * get(all_in, at + 2 * WIDTH)
            total = total + (get(moves, row) * get(all_in, at) + part)
        put(predicted, j * WIDTH, total)


@inlined
def correct(n, m, x, predicted, phi2, change):  # type: ignore[no-untyped-def]
    """Set the state to the predicted one and what the changes of the forces add."""
    for j in range(n):
        total = get(predicted, j * WIDTH)
        for i in range(m):
            total = total + get(phi2, (j * m + i) * WIDTH) * get(change, i * WIDTH)
        put(x, j * WIDTH, total)


@inlined
def push_late(n, m, x, phi1, phi2, share, jump):  # type: ignore[no-untyped-def]
    """Let the changes of stiff laws act over the whole of the step in the lanes that are hard."""
    for j in range(n):
        total = get(x, j * WIDTH)
        for i in range(m):
            at = (j * m + i) * WIDTH
            more = get(phi1, at) - get(phi2, at)
            total = total + get(share, i * WIDTH) * more * get(jump, i * WIDTH)
        put(x, j * WIDTH, total)
