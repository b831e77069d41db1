"""Parts of the time step: own states of effects, and laws that read a rate of change.

An own state whose rate depends on itself may fade faster than a sample (the filter of a sensor,
the bristle of a friction model).  It takes an exponential step,

    z' = z + h phi1(s h) r0 + h phi2(s h) (r1 - r0 - s (zp - z)),

with ``s = dr/dz``, the rates r0 and r1 at both ends and the predicted value zp: exact for a linear
filter of a straight line, of second order otherwise.  (Cox and Matthews 2002,
doi:10.1006/jcph.2002.6995.)

A law that is proportional to the rate of change of its own equation (an inertia that changes, an
inductance that falls) is solved for: with the rate r that all other laws give and the value f(r),
the equation ``a = r + g f(a)`` has the solution ``f(a) = f(r) r / (r - g f(r))``.
"""

import math

from motor_sysid.physics.native import call_lanes, compiled, inlined, LANES
from motor_sysid.physics.vector import get, put, spread, where, WIDTH

_FAR = 40.0
"""Beyond it exp(-z) is nothing to the last digit."""

_SERIES = tuple(1.0 / math.factorial(k) for k in range(11, 1, -1))
_TERMS = len(_SERIES)


@inlined
def own_slope(p, base, s, calls, offset, rate_row, size):  # type: ignore[no-untyped-def]
    """Return how fast own state `s` makes its own rate fall, never above zero.

    `calls` (S, 3) holds all rates, `size` is that of the difference that is taken; the rates must
    have been evaluated.
    """
    rate, value = get(p, rate_row), get(p, offset)
    put(p, rate_row, spread(0.0))
    put(p, offset, value + size)
    call_lanes(calls[s, 0], base, calls[s, 1], calls[s, 2])
    slope = min((get(p, rate_row) - rate) / size, 0.0)
    put(p, rate_row, rate)
    put(p, offset, value)
    return slope


@inlined
def predict_own(  # type: ignore[no-untyped-def]
    p, base, calls, fading, offsets, rates, h, old, old_rate, ahead
):  # fmt: skip
    """Move every own state to the end of the step of length `h` under its rate at the start.

    Keeps value and rate at the start in the rows `old` and `old_rate`, and what was reached in
    `ahead`.
    """
    for s in range(offsets.shape[0]):
        at, value, rate = s * WIDTH, get(p, offsets[s]), get(p, rates[s])
        put(old, at, value)
        put(old_rate, at, rate)
        reached = value + h * rate
        if fading[s]:
            size = h * abs(rate) + 1e-9 * abs(value) + 1e-30
            slope = own_slope(p, base, s, calls, offsets[s], rates[s], size)
            reached = value + h * phis(h * slope)[0] * rate
        put(ahead, at, reached)
    for s in range(offsets.shape[0]):
        put(p, offsets[s], get(ahead, s * WIDTH))


@inlined
def correct_own(  # type: ignore[no-untyped-def]
    p, base, calls, fading, offsets, rates, h, old, old_rate
):  # fmt: skip
    """Set every own state to its value at the end of the step; the rates there are known."""
    for s in range(offsets.shape[0]):
        offset, row = offsets[s], rates[s]
        before, begun, rate = get(old, s * WIDTH), get(old_rate, s * WIDTH), get(p, row)
        mean = 0.5 * (begun + rate)
        if fading[s]:
            size = h * (abs(begun) + abs(rate)) + 1e-9 * abs(before) + 1e-30
            slope = own_slope(p, base, s, calls, offset, row, size)
            first, second = phis(h * slope)
            ended = rate - slope * (get(p, offset) - before)
            mean = first * begun + second * (ended - begun)
        put(p, row, mean)
    for s in range(offsets.shape[0]):
        put(p, offsets[s], get(old, s * WIDTH) + h * get(p, rates[s]))


@inlined
def phis(z):  # type: ignore[no-untyped-def]
    """Return ``(exp(z) - 1) / z`` and ``(exp(z) - 1 - z) / z^2`` for vectors z up to 0.

    Without a call of exp for each number: a series for z / 64, its argument doubled six times, as
    in `motor_sysid.physics.exponential`.
    """
    r = max(z, -_FAR) / 64.0
    second = spread(1.0 / 479001600.0)
    for k in range(_TERMS):
        second = second * r + _SERIES[k]
    first = 1.0 + r * second
    for _ in range(6):
        second = 0.25 * first * first + 0.5 * second
        first = first * (1.0 + 0.5 * r * first)
        r = r * 2.0
    far, away = z < -_FAR, -1.0 / min(z, -_FAR)
    return where(far, away, first), where(far, away * (1.0 - away), second)


@compiled
def add_rate_laws(  # type: ignore[no-untyped-def]
    p, base, x, u, counts, linear, calls, forces, slope_rows, force_rows, own_state
):  # fmt: skip
    """Add the laws that read the rate of change of their own equation to the forces.

    Parameters
    ----------
    x, u:
        Rows of the core state, as loaded, and of the input; `counts` tells how many.
    linear:
        A (n, n), B (n, n_u), G (n, m) of the linear motor, a vector each.
    calls, forces:
        (K, 3) addresses and offsets of the laws, and the equation of each.
    slope_rows:
        (m,) rows of the buffer in which laws find the rate of each equation's own state.
    """
    a, b, g = linear
    n, n_u = counts
    m = force_rows.shape[0]
    for i in range(calls.shape[0]):
        j = forces[i]
        at, row = own_state[j], force_rows[j] * LANES
        rate = spread(0.0)
        for c in range(n):
            rate = rate + get(a, (at * n + c) * WIDTH) * get(x, c * WIDTH)
        for c in range(n_u):
            rate = rate + get(b, (at * n_u + c) * WIDTH) * get(u, c * WIDTH)
        for c in range(m):
            rate = rate + get(g, (at * m + c) * WIDTH) * get(p, force_rows[c] * LANES)
        others = get(p, row)
        put(p, slope_rows[j] * LANES, rate)
        call_lanes(calls[i, 0], base, calls[i, 1], calls[i, 2])
        force = get(p, row) - others
        left = rate - get(g, (at * m + j) * WIDTH) * force
        put(p, row, others + force * where(left != 0.0, rate / left, 1.0))
