"""What goes in and out of the state and the flat buffer of laws, a row of lanes at a time."""

from numba import njit

from motor_sysid.physics.effect import ARGUMENTS, FORCES
from motor_sysid.physics.native import call_lane, LANES
from motor_sysid.physics.track import row_in

TURN = ARGUMENTS.index('turn') * LANES
BEFORE = ARGUMENTS.index('theta_before') * LANES
STEP = ARGUMENTS.index('step') * LANES
SLOPE, VOLTAGE = ARGUMENTS.index('slope') * LANES, len(ARGUMENTS) + FORCES.index('voltage')


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def add_push(wide, p, force_rows, push, sample, now, begins, dt):  # type: ignore[no-untyped-def]
    """Add the forces from outside, (2, m, W) at both ends of the sample, at the time `now`."""
    for j in range(push.shape[2]):
        row = force_rows[j] * LANES
        for k in range(wide):
            share = (now[k] - begins[k]) / dt
            p[row + k] += push[sample, 0, j, k] + share * (
                push[sample, 1, j, k] - push[sample, 0, j, k]
            )


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def call_all(wide, base, calls, first, last):  # type: ignore[no-untyped-def]
    """Call lane functions `first` to `last`."""
    for i in range(first, last):
        call_lane(calls[i, 0], base, calls[i, 1], calls[i, 2], wide)  # type: ignore[call-arg]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def keep(wide, values, p, rows):  # type: ignore[no-untyped-def]
    """Copy rows of the buffer to `values` (R, W)."""
    for j in range(rows.shape[0]):
        row = rows[j] * LANES
        for k in range(wide):
            values[j, k] = p[row + k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def remember(wide, p, offsets, values):  # type: ignore[no-untyped-def]
    """Copy places in the buffer to `values` (S, W)."""
    for s in range(offsets.shape[0]):
        offset = offsets[s]
        for k in range(wide):
            values[s, k] = p[offset + k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def swap(wide, p, offsets, values):  # type: ignore[no-untyped-def]
    """Exchange `values` (S, W) and what is in their places in the buffer."""
    for s in range(offsets.shape[0]):
        offset = offsets[s]
        for k in range(wide):
            values[s, k], p[offset + k] = p[offset + k], values[s, k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def put(wide, p, offsets, values):  # type: ignore[no-untyped-def]
    """Copy `values` (S, W) to their places in the buffer."""
    for s in range(offsets.shape[0]):
        offset = offsets[s]
        for k in range(wide):
            p[offset + k] = values[s, k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def hold_input(wide, u, inputs, late, places, sample):  # type: ignore[no-untyped-def]
    """Write the input that acts in each lane to `u` (n_u, W)."""
    n_u, delayed, apart = inputs.shape[1], late.shape[0] > 0, places.shape[1] > 0
    if not (delayed or apart):
        for j in range(n_u):
            for k in range(wide):
                u[j, k] = inputs[sample, j]
        return
    for k in range(wide):
        at = sample - (late[k] if delayed else 0)
        at = row_in(places, k, at) if apart else max(at, 0)
        for j in range(n_u):
            u[j, k] = inputs[at, j]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def load_state(  # type: ignore[no-untyped-def]
    wide, p, x, state_rows, position_row, speed_row, follows, position, half, h
):
    """Write a core state to the argument rows, with the measured position in its place.

    That is the simulated one as far as it lies within `half` a count (rad) of the measured one.
    Beside it goes the angle that the shaft turns in a step of length `h` (W,).
    """
    if speed_row >= 0:
        for k in range(wide):
            p[TURN + k] = h[k] * x[speed_row, k]
    for j in range(x.shape[0]):
        row = state_rows[j] * LANES
        if follows and j == position_row:
            for k in range(wide):
                p[row + k] = within(x[j, k], position[k], half)
        else:
            for k in range(wide):
                p[row + k] = x[j, k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def within(value, middle, half):  # type: ignore[no-untyped-def]
    """Return a value, not more than `half` away from the middle."""
    return min(max(value, middle - half), middle + half)


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def confine(wide, values, middle, half):  # type: ignore[no-untyped-def]
    """Move `values` (W,) that are more than `half` away from the middle (W,) to there."""
    for k in range(wide):
        values[k] = within(values[k], middle[k], half)


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def begin_step(  # type: ignore[no-untyped-def]
    wide, p, x, position_row, follows, position, half, h
):
    """Write the angle at which a step of length `h` (W,) begins, and that length."""
    for k in range(wide):
        p[STEP + k] = h[k]
    if follows:
        for k in range(wide):
            p[BEFORE + k] = within(x[position_row, k], position[k], half)
    elif position_row >= 0:
        for k in range(wide):
            p[BEFORE + k] = x[position_row, k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def add_jumps(  # type: ignore[no-untyped-def]
    wide, p, base, x, calls, states, rows, laws, count, force_rows, secant
):
    """Add to states (n, W), which are loaded, what moves them at once.

    The first `count` of the `laws` tell what they add to each equation just now; their slopes by
    their own states are `secant` (m, W).
    """
    clear(wide, p, force_rows)
    call_all(wide, base, laws, 0, count)
    for j in range(force_rows.shape[0]):
        if force_rows[j] == VOLTAGE:
            for k in range(wide):
                p[SLOPE + k] = secant[j, k]
    clear(wide, p, rows)
    call_all(wide, base, calls, 0, calls.shape[0])
    for i in range(states.shape[0]):
        j, row = states[i], rows[i] * LANES
        for k in range(wide):
            x[j, k] += p[row + k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def clear(wide, p, rows):  # type: ignore[no-untyped-def]
    """Set the equation rows to zero."""
    for j in range(rows.shape[0]):
        row = rows[j] * LANES
        for k in range(wide):
            p[row + k] = 0.0


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def evaluate_rates(wide, p, base, calls, memory_rate):  # type: ignore[no-untyped-def]
    """Set the rates of all own states."""
    for s in range(memory_rate.shape[0]):
        row = memory_rate[s]
        for k in range(wide):
            p[row + k] = 0.0
    call_all(wide, base, calls, 0, calls.shape[0])


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def copy(wide, values, target):  # type: ignore[no-untyped-def]
    """Copy (n, W) values."""
    for j in range(target.shape[0]):
        for k in range(wide):
            target[j, k] = values[j, k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def positive(wide, values):  # type: ignore[no-untyped-def]
    """Return how many of (W,) values are positive."""
    count = 0
    for k in range(wide):
        count += 1 if values[k] > 0.0 else 0
    return count


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def blend(wide, x, rough, p, memory_offset, rough_memory, share):  # type: ignore[no-untyped-def]
    """Mix what finer steps lead to with what rough ones did, by the (W,) share of the finer."""
    for j in range(x.shape[0]):
        for k in range(wide):
            x[j, k] = rough[j, k] if share[k] == 0.0 else (
                rough[j, k] + share[k] * (x[j, k] - rough[j, k])
            )
    for s in range(memory_offset.shape[0]):
        row = memory_offset[s]
        for k in range(wide):
            old = rough_memory[s, k]
            p[row + k] = old if share[k] == 0.0 else old + share[k] * (p[row + k] - old)
