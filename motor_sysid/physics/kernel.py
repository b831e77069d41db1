"""The time loop: exact linear core, implicit second-order exponential steps for effects.

One sample of length ``h`` under a held input ``u`` advances

    dx/dt = A x + B u + G f(x, u, z)

by ``a = E x + h phi1(Ah) (B u + G f0)`` and ``x' = a + h phi2(Ah) G (f1 - f0)``, where
``E = exp(Ah)``, ``f0 = f(x)``, and ``f1`` is the force at the end of the step: at ``a``, but for
laws that are stiff in the one state of their own (speed for torque, current for voltage), whose
force is taken at the new value of that state.  Where such a law would turn within the step by more
than a quarter, phi1 takes the place of phi2 for it: the trapezoid would ring, the implicit Euler
step does not.  The linear motor is exact for any time constant.
(Cox and Matthews 2002, doi:10.1006/jcph.2002.6995, for exponential time differencing; Hairer and
Wanner, Solving Ordinary Differential Equations II, 1996, section IV.3, for stiff decay.)

An input delay of k samples and a fraction f cuts each sample in two pieces of its own length in
every lane: f under the older input, the rest under the newer one.  That is exact, too.

The kernel works on blocks of 32 parameter vectors; the last axis of every array is the lane.
"""

from numba import njit
import numpy as np

from motor_sysid.physics.native import call_lane, LANES
from motor_sysid.physics.own_states import add_rate_laws, correct_own, predict_own

TRIALS = 60
"""Most evaluations that the implicit step may take; it needs three or four."""

HARD = 0.25
"""Stiffness of a law over one substep above which the step is taken fully implicit."""

CLOSE = 1e-5
"""Error of the implicit step, relative to it, that is good enough."""


@njit(cache=True, nogil=True, error_model='numpy')
def run_block(  # type: ignore[no-untyped-def]
    step, phi1_input, phi1_force, phi2_force, width, substeps, dt, t0, first,
    inputs, late, position, buffer, base, x,
    state_rows, input_rows, force_rows, own_state, time_row,
    lane_address, lane_own, lane_state, stiff_count, stiff_force,
    rate_address, rate_own, rate_state, memory_offset, memory_rate, memory_fades,
    linear, slope_address, slope_own, slope_state, slope_force, slope_rows,
    sensor_address, sensor_own, sensor_state,
    output_state, output_rate, output_bias, output_sensor, outputs,
):  # fmt: skip
    """Simulate one block and write its outputs.

    Parameters
    ----------
    step, phi1_input, phi1_force, phi2_force:
        (S, n, n, W), (S, n, n_u, W), (S, n, m, W), (S, n, m, W) matrices of one substep of each of
        the S pieces of a sample; S is 1 without and 2 with an input delay.
    width:
        (S, W) length of a substep in s.
    substeps, dt, t0, first:
        Substeps per piece, sample time and time of the first row of inputs in s, and the row to
        begin at.
    inputs:
        (N, n_u) held inputs.
    late:
        (W,) whole samples that the input is late by.
    position:
        (N,) measured position for laws that depend on it, or empty.
    buffer, base:
        Flat work memory and its address; rows are described in `motor_sysid.physics.lanes`.
    x:
        (n, W) core state, advanced in place.
    memory_fades:
        For each own state whether its rate depends on itself.
    linear, slope_address, ...:
        The linear motor, and laws that read the rate of change of their own equation; see
        `motor_sysid.physics.own_states.add_rate_laws`.
    outputs:
        (N - first, n_y, W) model outputs at the sample times.
    """
    pieces, n, m, n_u = step.shape[0], step.shape[1], phi1_force.shape[2], inputs.shape[1]
    count = inputs.shape[0]
    n_lanes, n_slopes = lane_address.shape[0], slope_address.shape[0]
    n_memory = memory_offset.shape[0]
    rate_calls = (rate_address, rate_own, rate_state)
    slope_calls = (slope_address, slope_own, slope_state)
    work = np.empty((2, LANES))
    predicted = np.empty((n, LANES))
    before = np.zeros((m, LANES))
    stiff = np.zeros((m, LANES))
    change = np.empty((m, LANES))
    at_start, low, high, g_low, g_high, d, side = np.empty((7, LANES))
    begun_force, jump = np.zeros((m, LANES)), np.zeros((m, LANES))
    late_share, weights = np.zeros((m, LANES)), np.zeros((m, LANES))
    previous = x.copy()
    old_memory = np.empty((n_memory + 1, LANES))
    old_rate, next_memory = np.empty((n_memory + 1, LANES)), np.empty((n_memory + 1, LANES))
    u = np.empty((n_u, LANES))
    now, h = np.empty(LANES), np.empty(LANES)
    here, there = np.zeros(LANES), np.zeros(LANES)
    follows = position.shape[0] > 0
    position_row = -1
    for j in range(n):
        if state_rows[j] == 2:
            position_row = j

    for sample in range(first, count):
        if sensor_address.shape[0] > 0:
            for k in range(LANES):
                here[k] = position[sample] if follows else 0.0
                buffer[time_row * LANES + k] = t0 + sample * dt
            load_state(buffer, x, state_rows, position_row, follows, here)
            clear(buffer, output_sensor)
            for i in range(sensor_address.shape[0]):
                call_lane(sensor_address[i], base, sensor_own[i], sensor_state[i])
        for y in range(outputs.shape[1]):
            j = output_state[y]
            bias = output_bias[y] * LANES
            if output_rate[y]:
                scale = 1.0 / dt
                for k in range(LANES):
                    moved = x[j, k] - previous[j, k]
                    outputs[sample - first, y, k] = moved * scale + buffer[bias + k]
            else:
                for k in range(LANES):
                    outputs[sample - first, y, k] = x[j, k] + buffer[bias + k]
            if sensor_address.shape[0] > 0:
                row = output_sensor[y] * LANES
                for k in range(LANES):
                    outputs[sample - first, y, k] += buffer[row + k]
        for j in range(n):
            for k in range(LANES):
                previous[j, k] = x[j, k]

        for k in range(LANES):
            now[k] = t0 + sample * dt
        for part in range(pieces * substeps):
            piece = part // substeps
            hold_input(u, inputs, late, sample - (pieces - 1 - piece))
            for j in range(n_u):
                row = input_rows[j] * LANES
                for k in range(LANES):
                    buffer[row + k] = u[j, k]
            for k in range(LANES):
                h[k] = width[piece, k]
                buffer[time_row * LANES + k] = now[k]
            if follows:
                base_position = position[sample]
                slope = (position[min(sample + 1, count - 1)] - base_position) / dt
                begun = t0 + sample * dt
                for k in range(LANES):
                    here[k] = base_position + slope * (now[k] - begun)
                    there[k] = here[k] + slope * h[k]

            # stage 0: every law at the state
            load_state(buffer, x, state_rows, position_row, follows, here)
            clear(buffer, force_rows)
            for i in range(stiff_count):
                call_lane(lane_address[i], base, lane_own[i], lane_state[i])
            for j in range(m):
                row = force_rows[j] * LANES
                for k in range(LANES):
                    stiff[j, k] = buffer[row + k]
                    begun_force[j, k] = buffer[row + k]
            for i in range(stiff_count, n_lanes):
                call_lane(lane_address[i], base, lane_own[i], lane_state[i])
            if n_slopes > 0:
                add_rate_laws(
                    buffer, base, x, u, linear, slope_calls, slope_force, slope_rows,
                    force_rows, own_state, work,
                )  # fmt: skip
            for j in range(m):
                row = force_rows[j] * LANES
                for k in range(LANES):
                    before[j, k] = buffer[row + k]
            if n_memory > 0:
                evaluate_rates(buffer, base, rate_address, rate_own, rate_state, memory_rate)
                predict_own(
                    buffer, base, rate_calls, memory_fades, memory_offset, memory_rate, h,
                    old_memory, old_rate, next_memory, work,
                )  # fmt: skip

            # predictor
            for j in range(n):
                for k in range(LANES):
                    predicted[j, k] = 0.0
                for i in range(n):
                    for k in range(LANES):
                        predicted[j, k] += step[piece, j, i, k] * x[i, k]
                for i in range(n_u):
                    for k in range(LANES):
                        predicted[j, k] += phi1_input[piece, j, i, k] * u[i, k]
                if n_lanes + n_slopes > 0:
                    for i in range(m):
                        for k in range(LANES):
                            predicted[j, k] += phi1_force[piece, j, i, k] * before[i, k]
            for k in range(LANES):
                now[k] += h[k]
            if n_lanes + n_slopes == 0 and n_memory == 0:
                for j in range(n):
                    for k in range(LANES):
                        x[j, k] = predicted[j, k]
                continue

            # stage 2: stiff laws with only their own state moved
            if stiff_count > 0:
                load_state(buffer, x, state_rows, position_row, follows, here)
                clear(buffer, force_rows)
                for s in range(n_memory):
                    offset = memory_offset[s]
                    for k in range(LANES):
                        buffer[offset + k] = old_memory[s, k]
                for j in range(m):
                    own = own_state[j]
                    row = state_rows[own] * LANES
                    for k in range(LANES):
                        buffer[row + k] = predicted[own, k]
                    for i in range(stiff_count):
                        if stiff_force[i] == j:
                            call_lane(lane_address[i], base, lane_own[i], lane_state[i])
                    for k in range(LANES):
                        buffer[row + k] = x[own, k]
                for j in range(m):
                    own = own_state[j]
                    row = force_rows[j] * LANES
                    for k in range(LANES):
                        moved = predicted[own, k] - x[own, k]
                        secant = (buffer[row + k] - stiff[j, k]) * moved / (moved * moved + 1e-30)
                        stiff[j, k] = min(secant, 0.0)
                for s in range(n_memory):
                    offset = memory_offset[s]
                    for k in range(LANES):
                        buffer[offset + k] = next_memory[s, k]

            # stage 1: every law at the predicted state
            load_state(buffer, predicted, state_rows, position_row, follows, there)
            if n_memory > 0:
                evaluate_rates(buffer, base, rate_address, rate_own, rate_state, memory_rate)
                correct_own(
                    buffer, base, rate_calls, memory_fades, memory_offset, memory_rate, h,
                    old_memory, old_rate, work,
                )  # fmt: skip
            clear(buffer, force_rows)
            for i in range(n_lanes):
                call_lane(lane_address[i], base, lane_own[i], lane_state[i])
            if n_slopes > 0:
                add_rate_laws(
                    buffer, base, predicted, u, linear, slope_calls, slope_force, slope_rows,
                    force_rows, own_state, work,
                )  # fmt: skip

            # corrector: stiff laws at the end of the step, found by a bracketed regula falsi
            for j in range(m):
                row = force_rows[j] * LANES
                for k in range(LANES):
                    before[j, k] = buffer[row + k] - before[j, k]
            for j in range(m):
                own = own_state[j]
                for k in range(LANES):
                    change[j, k] = 0.0
                for i in range(m):
                    for k in range(LANES):
                        change[j, k] += phi2_force[piece, own, i, k] * before[i, k]
            for j in range(m):
                for k in range(LANES):
                    jump[j, k] = 0.0
                    late_share[j, k] = 0.0
            for j in range(m):
                if stiff_count == 0:
                    break
                own = own_state[j]
                row = state_rows[own] * LANES
                load_state(buffer, predicted, state_rows, position_row, follows, there)
                clear(buffer, force_rows)
                for i in range(stiff_count):
                    if stiff_force[i] == j:
                        call_lane(lane_address[i], base, lane_own[i], lane_state[i])
                for k in range(LANES):
                    at_start[k] = buffer[force_rows[j] * LANES + k]
                    first_jump = at_start[k] - begun_force[j, k]
                    p2, p1 = phi2_force[piece, own, j, k], phi1_force[piece, own, j, k]
                    hard = -p2 * stiff[j, k] > HARD
                    late_share[j, k] = 1.0 if hard else 0.0
                    weight = p1 if hard else p2
                    weights[j, k] = weight
                    c = change[j, k] + (weight - p2) * first_jump
                    change[j, k] = c
                    low[k], high[k] = 0.0, c
                    g_low[k] = -c
                    g_high[k] = 1e300
                    side[k] = 0.0
                    d[k] = c / (1.0 - weight * stiff[j, k])
                for trial in range(TRIALS):
                    clear(buffer, force_rows)
                    for k in range(LANES):
                        buffer[row + k] = predicted[own, k] + d[k]
                    for i in range(stiff_count):
                        if stiff_force[i] == j:
                            call_lane(lane_address[i], base, lane_own[i], lane_state[i])
                    worst = 0.0
                    for k in range(LANES):
                        now_force = buffer[force_rows[j] * LANES + k]
                        jump[j, k] = now_force - begun_force[j, k]
                        c = change[j, k]
                        g = d[k] - c - weights[j, k] * (now_force - at_start[k])
                        off = abs(g) / (abs(c) + 1e-4 * abs(predicted[own, k]) + 1e-300)
                        if off > worst:
                            worst = off
                        up = c > 0.0
                        if (g > 0.0) == up:
                            high[k], g_high[k] = d[k], g
                            if side[k] > 0.0:
                                g_low[k] *= 0.5
                            side[k] = 1.0
                        else:
                            low[k], g_low[k] = d[k], g
                            if side[k] < 0.0:
                                g_high[k] *= 0.5
                            side[k] = -1.0
                        if off < CLOSE:
                            continue  # a lane that is there stays, whatever the others do
                        overshoots = d[k] * (predicted[own, k] + d[k]) > 0.0
                        if trial == 0 and overshoots and -predicted[own, k] * c > 0.0:
                            d[k] = -predicted[own, k]
                        elif g_high[k] > 1e299 or g_high[k] == g_low[k]:
                            d[k] = 0.5 * (low[k] + high[k])
                        else:
                            share = g_high[k] / (g_high[k] - g_low[k])
                            d[k] = high[k] - share * (high[k] - low[k])
                    if worst < CLOSE:
                        break
                for k in range(LANES):
                    # what is left are the laws that are not stiff
                    before[j, k] -= at_start[k] - begun_force[j, k]
            for j in range(n):
                for k in range(LANES):
                    x[j, k] = predicted[j, k]
                for i in range(m):
                    for k in range(LANES):
                        x[j, k] += phi2_force[piece, j, i, k] * before[i, k]
                if stiff_count > 0:
                    for i in range(m):
                        for k in range(LANES):
                            part1, part2 = phi1_force[piece, j, i, k], phi2_force[piece, j, i, k]
                            x[j, k] += (part1 if late_share[i, k] > 0 else part2) * jump[i, k]


@njit(cache=True, nogil=True, error_model='numpy')
def hold_input(u, inputs, late, sample):  # type: ignore[no-untyped-def]
    """Write the input that acts in each lane to `u` (n_u, W)."""
    n_u = inputs.shape[1]
    if late.shape[0] == 0:
        for j in range(n_u):
            for k in range(LANES):
                u[j, k] = inputs[sample, j]
        return
    for k in range(LANES):
        at = max(sample - late[k], 0)
        for j in range(n_u):
            u[j, k] = inputs[at, j]


@njit(cache=True, nogil=True, error_model='numpy')
def load_state(buffer, x, state_rows, position_row, follows, position):  # type: ignore[no-untyped-def]
    """Write a core state to the argument rows, with the measured position in its place."""
    for j in range(x.shape[0]):
        row = state_rows[j] * LANES
        if follows and j == position_row:
            for k in range(LANES):
                buffer[row + k] = position[k]
        else:
            for k in range(LANES):
                buffer[row + k] = x[j, k]


@njit(cache=True, nogil=True, error_model='numpy')
def clear(buffer, rows):  # type: ignore[no-untyped-def]
    """Set the equation rows to zero."""
    for j in range(rows.shape[0]):
        row = rows[j] * LANES
        for k in range(LANES):
            buffer[row + k] = 0.0


@njit(cache=True, nogil=True, error_model='numpy')
def evaluate_rates(buffer, base, address, own, state, memory_rate):  # type: ignore[no-untyped-def]
    """Set the rates of all own states."""
    for s in range(memory_rate.shape[0]):
        for k in range(LANES):
            buffer[memory_rate[s] + k] = 0.0
    for i in range(address.shape[0]):
        call_lane(address[i], base, own[i], state[i])
