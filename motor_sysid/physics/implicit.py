"""The implicit part of a time step: stiff laws at the end of the step.

A stiff law reads the own state of its equation.  With the change ``c`` of that state without the
law's own answer to it, and the weight ``w`` of its force, the change ``d`` solves

    d = c + w (f(x + d) - f(x)).

A regula falsi finds it, with the Illinois rule (Dowell and Jarratt 1971, doi:10.1007/BF01934364),
in all lanes at once: a law that damps has one root between 0 and c, however steep it is.  A law
that feeds (a friction that falls as the motion begins) has its root beyond c; until one end of a
bracket is known there, the secant from 0 leads on.
"""

from motor_sysid.physics.effect import FORCES
from motor_sysid.physics.native import call_lanes, inlined, LANES
from motor_sysid.physics.vector import get, put, some, spread, where, WIDTH

TRIALS = 60
"""Most evaluations that the implicit step may take; it needs one to four."""

HARD = 0.25
"""Weight of a stiff law's old force, times its slope, above which the step is fully implicit.

The trapezoid would ring there.  Where the linear motor itself forgets the old force within the
step it does not, however steep the law.
"""

CLOSE = 1e-5
"""Error of the implicit step, relative to it, that is good enough."""

FURTHEST = 2.0
"""Change of the own state in units of c up to which the root of a law that feeds is looked for:
beyond, the step is too long for the law."""

TURNS, MOVES = (0.1, 0.3), (1e-5, 1e-4)
"""Change of a stiff law within a step, in units of the most that it has been, and of its own state
by that, in units of the most that this has been: up to the first, one step will do; from the
second on only finer ones count."""

_OPEN, _KNOWN = 1e300, 1e299

KEPT_ROWS = 2 * len(FORCES)
"""Rows that are kept from step to step: the most that the stiff laws of each equation have been,
and then the most of its own state."""


@inlined
def call_stiff(base, calls, count, forces, j):  # type: ignore[no-untyped-def]
    """Call the stiff laws of equation `j`."""
    for i in range(count):
        if forces[i] == j:
            call_lanes(calls[i, 0], base, calls[i, 1], calls[i, 2])


@inlined
def secants(  # type: ignore[no-untyped-def]
    p, base, calls, count, forces, answers, state_rows, force_rows, own_state, x, predicted,
    begun, secant,
):  # fmt: skip
    """Set the rows `secant` to the slope of the stiff laws of equations that `answers` marks.

    That is their slope in the own state of the equation.  The state `x` is loaded; `begun` holds
    the stiff laws there.
    """
    for j in range(own_state.shape[0]):
        if answers[j] == 0.0:
            continue
        target, row = force_rows[j] * LANES, state_rows[own_state[j]] * LANES
        before, ahead = get(x, own_state[j] * WIDTH), get(predicted, own_state[j] * WIDTH)
        put(p, target, spread(0.0))
        put(p, row, ahead)
        call_stiff(base, calls, count, forces, j)
        moved, change = ahead - before, get(p, target) - get(begun, j * WIDTH)
        put(secant, j * WIDTH, min(change * moved / (moved * moved + 1e-30), 0.0))
        put(p, row, before)


@inlined
def weighed(change, law, steep, phi1, phi2):  # type: ignore[no-untyped-def]
    """Return what the implicit step of an equation begins with.

    Parameters
    ----------
    change:
        Change of the own state that all changes of forces over the step add to the prediction.
    law:
        Change of the stiff laws over the step, to the predicted state.
    steep:
        Slope of the stiff laws.
    phi1, phi2:
        What a constant force of one, and one that rises to one, add to the own state.

    Returns
    -------
    Where the step is hard, the weight of the force, the change c, and a first guess of the root.
    """
    hard = (phi2 - phi1) * steep > HARD
    weight = where(hard, phi1, phi2)
    c = change + (weight - phi2) * law
    return hard, weight, c, c / (1.0 - weight * steep)


@inlined
def settle(  # type: ignore[no-untyped-def]
    p, base, calls, count, forces, j, row, target, predicted, start, weight, c, d
):  # fmt: skip
    """Return the stiff laws at the end of the step.

    Parameters
    ----------
    row, target:
        Places in the buffer of the own state and of the force.
    predicted, start:
        The predicted own state, and the stiff laws there.
    weight, c, d:
        See `weighed`.
    """
    low, high, g_low, g_high, side = spread(0.0), c, -c, spread(_OPEN), spread(0.0)
    force = start
    for trial in range(TRIALS):
        put(p, target, spread(0.0))
        put(p, row, predicted + d)
        call_stiff(base, calls, count, forces, j)
        force = get(p, target)
        g = d - c - weight * (force - start)
        far = abs(g) >= CLOSE * (abs(c) + 1e-4 * abs(predicted) + 1e-300)
        if not some(far):
            break
        d, far, low, high, g_low, g_high, side = narrow(
            d, g, far, c, predicted, low, high, g_low, g_high, side, trial == 0
        )
        if not some(far):
            break
    return force


@inlined
def narrow(  # type: ignore[no-untyped-def]
    d, g, far, c, predicted, low, high, g_low, g_high, side, first
):  # fmt: skip
    """Take one step of the regula falsi in every lane that is `far` from its root.

    `g` is how far `d` is from solving the equation; `low` to `high` is the bracket, with `g_low`
    and `g_high` at its ends, and `side` the end that moved last, by its sign.

    Returns
    -------
    The next `d`, where it is still to be tried, and the bracket.
    """
    above = (g > 0.0) == (c > 0.0)
    known = g_high < _KNOWN
    g_low = where(above, g_low * where(side > 0.0, 0.5, 1.0), g)
    g_high = where(above, g, g_high * where((side < 0.0) & known, 0.5, 1.0))
    low, high = where(above, low, d), where(above, d, high)
    gap = g_high - g_low
    inside = where(gap == 0.0, 0.5 * (low + high), high - g_high / gap * (high - low))
    ahead, most = d - g * d / (g + c), FURTHEST * c
    ahead = where(((ahead - d) * c > 0.0) & ((most - ahead) * c > 0.0), ahead, most)
    following = where(g_high > _KNOWN, ahead, inside)
    far = far & (above | (abs(d) < abs(most)))
    if first:
        stops = (d * (predicted + d) > 0.0) & (-predicted * c > 0.0)
        following = where(stops, -predicted, following)
    side = where(above, spread(1.0), spread(-1.0))
    # a lane that is there stays, whatever the others do
    return where(far, following, d), far, low, high, g_low, g_high, side


@inlined
def has_turned(most, j, law, change, phi2, state):  # type: ignore[no-untyped-def]
    """Return how far the stiff laws of equation `j` have turned in a step.

    `law` is what they were at its beginning, `change` by how much they changed, and `state` their
    own state.  It grows steadily from 0 to 1, so that differences between lanes stay smooth.
    `most` holds the `KEPT_ROWS`.
    """
    law_at, state_at = j * LANES, (len(FORCES) + j) * LANES
    much, far = max(get(most, law_at), abs(law)), max(get(most, state_at), abs(state))
    put(most, law_at, much)
    put(most, state_at, far)
    size = abs(change)
    turn = ramp(size / (much + 1e-300), TURNS[0], TURNS[1])
    return turn * ramp(size * abs(phi2) / (far + 1e-300), MOVES[0], MOVES[1])


@inlined
def ramp(value, low, high):  # type: ignore[no-untyped-def]
    """Return 0 below `low`, 1 above `high`, and what leads smoothly from one to the other."""
    x = min(max((value - low) / (high - low), 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)
