"""What goes in and out of the state and the flat buffer of laws, a vector of lanes at a time.

Pointers to the buffer, `p`, are to the first lane of the vector; its rows lie `LANES` numbers
apart, those of the kernel's own memory `WIDTH`.
"""

from motor_sysid.physics.effect import ARGUMENTS, FORCES
from motor_sysid.physics.native import call_lanes, inlined, LANES
from motor_sysid.physics.track import row_in
from motor_sysid.physics.vector import get, put, spread, where, WIDTH, with_element

TURN = ARGUMENTS.index('turn') * LANES
BEFORE = ARGUMENTS.index('theta_before') * LANES
STEP = ARGUMENTS.index('step') * LANES
SLOPE, VOLTAGE = ARGUMENTS.index('slope') * LANES, len(ARGUMENTS) + FORCES.index('voltage')


@inlined
def add_push(p, force_rows, push, at, share):  # type: ignore[no-untyped-def]
    """Add the forces from outside, two rows for each, at the `share` of the time between them."""
    count = force_rows.shape[0]
    for j in range(count):
        row = force_rows[j] * LANES
        begins, ends = get(push, at + j * LANES), get(push, at + (count + j) * LANES)
        put(p, row, get(p, row) + (begins + share * (ends - begins)))


@inlined
def call_all(base, calls, first, last):  # type: ignore[no-untyped-def]
    """Call laws `first` to `last`."""
    for i in range(first, last):
        call_lanes(calls[i, 0], base, calls[i, 1], calls[i, 2])


@inlined
def keep(values, p, rows):  # type: ignore[no-untyped-def]
    """Copy rows of the buffer to `values`."""
    for j in range(rows.shape[0]):
        put(values, j * WIDTH, get(p, rows[j] * LANES))


@inlined
def remember(p, offsets, values):  # type: ignore[no-untyped-def]
    """Copy places in the buffer to `values`."""
    for s in range(offsets.shape[0]):
        put(values, s * WIDTH, get(p, offsets[s]))


@inlined
def swap(p, offsets, values):  # type: ignore[no-untyped-def]
    """Exchange `values` and what is in their places in the buffer."""
    for s in range(offsets.shape[0]):
        kept = get(values, s * WIDTH)
        put(values, s * WIDTH, get(p, offsets[s]))
        put(p, offsets[s], kept)


@inlined
def restore(p, offsets, values):  # type: ignore[no-untyped-def]
    """Copy `values` to their places in the buffer."""
    for s in range(offsets.shape[0]):
        put(p, offsets[s], get(values, s * WIDTH))


@inlined
def hold_input(u, inputs, late, places, first, sample):  # type: ignore[no-untyped-def]
    """Write the input that acts in lane `first` and the next ones to the rows `u`."""
    n_u, delayed, apart = inputs.shape[1], late.shape[0] > 0, places.shape[1] > 0
    if not (delayed or apart):
        for j in range(n_u):
            put(u, j * WIDTH, spread(inputs[sample, j]))
        return
    for j in range(n_u):
        held = spread(0.0)
        for k in range(WIDTH):
            at = sample - (late[first + k] if delayed else 0)
            at = row_in(places, first + k, at) if apart else max(at, 0)
            held = with_element(held, k, inputs[at, j])
        put(u, j * WIDTH, held)


@inlined
def load_state(  # type: ignore[no-untyped-def]
    p, x, state_rows, position_row, speed_row, follows, position, half, h
):
    """Write a core state to the argument rows, with the measured position in its place.

    That is the simulated one as far as it lies within `half` a count (rad) of the measured one.
    Beside it goes the angle that the shaft turns in a step of length `h`.
    """
    if speed_row >= 0:
        put(p, TURN, h * get(x, speed_row * WIDTH))
    for j in range(state_rows.shape[0]):
        value = get(x, j * WIDTH)
        if follows and j == position_row:
            value = within(value, position, half)
        put(p, state_rows[j] * LANES, value)


@inlined
def within(value, middle, half):  # type: ignore[no-untyped-def]
    """Return a value, not more than `half` away from the middle."""
    return min(max(value, middle - half), middle + half)


@inlined
def begin_step(p, x, position_row, follows, position, half, h):  # type: ignore[no-untyped-def]
    """Write the angle at which a step of length `h` begins, and that length."""
    put(p, STEP, h)
    if position_row >= 0:
        angle = get(x, position_row * WIDTH)
        put(p, BEFORE, within(angle, position, half) if follows else angle)


@inlined
def add_jumps(  # type: ignore[no-untyped-def]
    p, base, x, calls, states, rows, laws, count, force_rows, secant
):
    """Add to states, which are loaded, what moves them at once.

    The first `count` of the `laws` tell what they add to each equation just now; their slopes by
    their own states are `secant`.
    """
    clear(p, force_rows)
    call_all(base, laws, 0, count)
    for j in range(force_rows.shape[0]):
        if force_rows[j] == VOLTAGE:
            put(p, SLOPE, get(secant, j * WIDTH))
    clear(p, rows)
    call_all(base, calls, 0, calls.shape[0])
    for i in range(states.shape[0]):
        at = states[i] * WIDTH
        put(x, at, get(x, at) + get(p, rows[i] * LANES))


@inlined
def clear(p, rows):  # type: ignore[no-untyped-def]
    """Set rows of the buffer to zero."""
    for j in range(rows.shape[0]):
        put(p, rows[j] * LANES, spread(0.0))


@inlined
def evaluate_rates(p, base, calls, memory_rate):  # type: ignore[no-untyped-def]
    """Set the rates of all own states."""
    for s in range(memory_rate.shape[0]):
        put(p, memory_rate[s], spread(0.0))
    call_all(base, calls, 0, calls.shape[0])


@inlined
def copy(count, values, target):  # type: ignore[no-untyped-def]
    """Copy so many rows."""
    for j in range(count):
        put(target, j * WIDTH, get(values, j * WIDTH))


@inlined
def blend(count, x, rough, p, memory_offset, rough_memory, share):  # type: ignore[no-untyped-def]
    """Mix what finer steps lead to with what rough ones did, by the `share` of the finer."""
    for j in range(count):
        put(x, j * WIDTH, mixed(get(rough, j * WIDTH), get(x, j * WIDTH), share))
    for s in range(memory_offset.shape[0]):
        row = memory_offset[s]
        put(p, row, mixed(get(rough_memory, s * WIDTH), get(p, row), share))


@inlined
def mixed(rough, fine, share):  # type: ignore[no-untyped-def]
    """Return a value between two, the first where the `share` of the other is zero."""
    return where(share == 0.0, rough, rough + share * (fine - rough))
