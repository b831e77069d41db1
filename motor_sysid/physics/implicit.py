"""The implicit part of a time step: stiff laws at the end of the step.

A stiff law reads the own state of its equation.  With the change ``c`` of that state without the
law's own answer to it, and the weight ``w`` of its force, the change ``d`` solves

    d = c + w (f(x + d) - f(x)).

A regula falsi finds it, with the Illinois rule (Dowell and Jarratt 1971, doi:10.1007/BF01934364),
in all lanes at once: a law that damps has one root between 0 and c, however steep it is.  A law
that feeds (a friction that falls as the motion begins) has its root beyond c; until one end of a
bracket is known there, the secant from 0 leads on.  Every choice is a select, not a branch, so
that the loops are vectorized.
"""

from numba import njit

from motor_sysid.physics.effect import FORCES
from motor_sysid.physics.native import call_lane, LANES

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

# rows of the work memory of one solution
JUMP = 0
HARD_ROW = 1 * LANES
_PREDICTED = 2 * LANES
_CHANGE = 3 * LANES
_START = 4 * LANES
_WEIGHT = 5 * LANES
_D = 6 * LANES
_LOW = 7 * LANES
_HIGH = 8 * LANES
_G_LOW = 9 * LANES
_G_HIGH = 10 * LANES
_SIDE = 11 * LANES
_PHI2 = 12 * LANES
ROWS = 13

KEPT_ROWS = 2 * len(FORCES)
"""Rows that are kept from step to step: the most that the stiff laws of each equation have been,
and then the most of its own state."""


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def call_stiff(wide, base, calls, count, forces, j):  # type: ignore[no-untyped-def]
    """Call the stiff laws of equation `j`."""
    for i in range(count):
        if forces[i] == j:
            call_lane(calls[i, 0], base, calls[i, 1], calls[i, 2], wide)  # type: ignore[call-arg]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def secants(  # type: ignore[no-untyped-def]
    wide, p, base, calls, count, forces, answers, state_rows, force_rows, own_state, x,
    predicted, begun, secant,
):  # fmt: skip
    """Set `secant` (m, W) to the slope of the stiff laws of equations that `answers` marks.

    That is their slope in the own state of the equation.  The state `x` (n, W) is loaded; `begun`
    (m, W) holds the stiff laws there.
    """
    for j in range(own_state.shape[0]):
        if not answers[j]:
            continue
        own, target = own_state[j], force_rows[j] * LANES
        row = state_rows[own] * LANES
        for k in range(wide):
            p[target + k] = 0.0
            p[row + k] = predicted[own, k]
        call_stiff(wide, base, calls, count, forces, j)
        for k in range(wide):
            moved, change = predicted[own, k] - x[own, k], p[target + k] - begun[j, k]
            secant[j, k] = min(change * moved / (moved * moved + 1e-30), 0.0)
            p[row + k] = x[own, k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def prepare(  # type: ignore[no-untyped-def]
    wide, w, j, own, predicted, change, begun, start, secant, phi1_force, phi2_force, piece
):  # fmt: skip
    """Fill the work memory `w` of equation `j`; return how many lanes are hard.

    `change` (m, W) is the change of all forces over the step, `begun` and `start` the stiff laws
    at its beginning and at the predicted state.  Row `HARD_ROW` gets 1 where a lane is, else 0.
    """
    for k in range(wide):
        w[_CHANGE + k] = 0.0
    for i in range(change.shape[0]):
        for k in range(wide):
            w[_CHANGE + k] += phi2_force[piece, own, i, k] * change[i, k]
    count = 0
    for k in range(wide):
        p2, p1, steep = phi2_force[piece, own, j, k], phi1_force[piece, own, j, k], secant[j, k]
        stiff = (p2 - p1) * steep > HARD
        weight = p1 if stiff else p2
        c = w[_CHANGE + k] + (weight - p2) * (start[j, k] - begun[j, k])
        w[_PREDICTED + k], w[_START + k] = predicted[own, k], start[j, k]
        w[_PHI2 + k], w[JUMP + k] = p2, begun[j, k]
        w[HARD_ROW + k], w[_WEIGHT + k] = 1.0 if stiff else 0.0, weight
        w[_CHANGE + k] = c
        w[_LOW + k], w[_HIGH + k] = 0.0, c
        w[_G_LOW + k], w[_G_HIGH + k] = -c, _OPEN
        w[_SIDE + k] = 0.0
        w[_D + k] = c / (1.0 - weight * steep)
    for k in range(wide):
        count += 1 if w[HARD_ROW + k] > 0.0 else 0  # whole numbers are summed side by side
    return count


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def settle(wide, p, base, calls, count, forces, j, row, target, w):  # type: ignore[no-untyped-def]
    """Solve for the end of the step; row `JUMP` of `w` gets the change of the stiff laws.

    `row` and `target` are the places in the buffer of the own state and of the force.
    """
    for trial in range(TRIALS):
        for k in range(wide):
            p[target + k] = 0.0
            p[row + k] = w[_PREDICTED + k] + w[_D + k]
        call_stiff(wide, base, calls, count, forces, j)
        if count_far(wide, p, target, w) == 0 or narrow(wide, p, target, w, trial == 0) == 0:
            break
    for k in range(wide):
        w[JUMP + k] = p[target + k] - w[JUMP + k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def count_far(wide, p, target, w):  # type: ignore[no-untyped-def]
    """Return in how many lanes the end of the step is not found yet; mostly, in none."""
    left = 0
    for k in range(wide):
        c = w[_CHANGE + k]
        g = w[_D + k] - c - w[_WEIGHT + k] * (p[target + k] - w[_START + k])
        far = abs(g) >= CLOSE * (abs(c) + 1e-4 * abs(w[_PREDICTED + k]) + 1e-300)
        left += 1 if far else 0
    return left


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def narrow(wide, p, target, w, first):  # type: ignore[no-untyped-def]
    """Take one step of the regula falsi in every lane that is not there; return how many."""
    left = 0
    for k in range(wide):
        d, c, predicted = w[_D + k], w[_CHANGE + k], w[_PREDICTED + k]
        g = d - c - w[_WEIGHT + k] * (p[target + k] - w[_START + k])
        far = abs(g) >= CLOSE * (abs(c) + 1e-4 * abs(predicted) + 1e-300)
        above = (g > 0.0) == (c > 0.0)
        side = w[_SIDE + k]
        low, high, g_low, g_high = w[_LOW + k], w[_HIGH + k], w[_G_LOW + k], w[_G_HIGH + k]
        known = g_high < _KNOWN
        g_low = g_low * (0.5 if side > 0.0 else 1.0) if above else g
        g_high = g if above else g_high * (0.5 if side < 0.0 and known else 1.0)
        low = low if above else d
        high = d if above else high
        gap = g_high - g_low
        inside = high - g_high / gap * (high - low)
        inside = 0.5 * (low + high) if gap == 0.0 else inside
        ahead = d - g * d / (g + c)
        most = FURTHEST * c
        ahead = ahead if (ahead - d) * c > 0.0 and (most - ahead) * c > 0.0 else most
        following = ahead if g_high > _KNOWN else inside
        far = far and (above or abs(d) < abs(most))
        stops = first and d * (predicted + d) > 0.0 and -predicted * c > 0.0
        following = -predicted if stops else following
        w[_LOW + k], w[_HIGH + k], w[_G_LOW + k], w[_G_HIGH + k] = low, high, g_low, g_high
        w[_SIDE + k] = 1.0 if above else -1.0
        w[_D + k] = following if far else d  # a lane that is there stays, whatever the others do
        left += 1 if far else 0
    return left


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def mark_turned(wide, w, most, j, begun, own, state, turned):  # type: ignore[no-untyped-def]
    """Raise `turned` (W,) in lanes in which the stiff laws of equation `j` have turned.

    `begun` (m, W) holds them at the beginning of the step, row `JUMP` their change, row `own` of
    `state` (n, W) their own state.  It grows steadily from 0 to 1, so that differences between
    lanes stay smooth.  `most` holds the `KEPT_ROWS`.
    """
    law, largest = j * LANES, (len(FORCES) + j) * LANES
    for k in range(wide):
        much = max(most[law + k], abs(begun[j, k]))
        far = max(most[largest + k], abs(state[own, k]))
        most[law + k], most[largest + k] = much, far
        change = abs(w[JUMP + k])
        turn = ramp(change / (much + 1e-300), TURNS[0], TURNS[1])
        move = ramp(change * abs(w[_PHI2 + k]) / (far + 1e-300), MOVES[0], MOVES[1])
        turned[k] = max(turned[k], turn * move)


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def ramp(value, low, high):  # type: ignore[no-untyped-def]
    """Return 0 below `low`, 1 above `high`, and what leads smoothly from one to the other."""
    x = min(max((value - low) / (high - low), 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)
