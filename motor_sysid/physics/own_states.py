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

from numba import njit

from motor_sysid.physics.native import call_lane, LANES

_FAR = 40.0
"""Beyond it exp(-z) is nothing to the last digit."""

_SERIES = tuple(1.0 / math.factorial(k) for k in range(11, 1, -1))
_TERMS = len(_SERIES)


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def own_slope(wide, p, base, s, calls, offset, rate_row, work):  # type: ignore[no-untyped-def]
    """Set ``work[1]`` to how fast own state `s` makes its own rate fall, never above zero.

    `calls` (S, 3) holds all rates, ``work[0]`` the size of the difference that is taken,
    ``work[2]`` memory; the rates must have been evaluated.
    """
    for k in range(wide):
        work[1, k] = p[rate_row + k]
        p[rate_row + k] = 0.0
        work[2, k] = p[offset + k]
        p[offset + k] = work[2, k] + work[0, k]
    call_lane(calls[s, 0], base, calls[s, 1], calls[s, 2], wide)
    for k in range(wide):
        here = work[1, k]
        work[1, k] = min((p[rate_row + k] - here) / work[0, k], 0.0)
        p[rate_row + k] = here
        p[offset + k] = work[2, k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def predict_own(  # type: ignore[no-untyped-def]
    wide, p, base, calls, fading, offsets, rates, h, old, old_rate, ahead, work
):  # fmt: skip
    """Move every own state to the end of the step under its rate at the start.

    Keeps value and rate at the start in `old` and `old_rate`, and what was reached in `ahead` (at
    least S, W); `work` is (3, W).
    """
    for s in range(offsets.shape[0]):
        offset, row = offsets[s], rates[s]
        for k in range(wide):
            old[s, k] = p[offset + k]
            old_rate[s, k] = p[row + k]
            ahead[s, k] = old[s, k] + h[k] * old_rate[s, k]
        if fading[s]:
            for k in range(wide):
                work[0, k] = h[k] * abs(old_rate[s, k]) + 1e-9 * abs(old[s, k]) + 1e-30
            own_slope(wide, p, base, s, calls, offset, row, work)
            for k in range(wide):
                first, _ = phis(h[k] * work[1, k])
                ahead[s, k] = old[s, k] + h[k] * first * old_rate[s, k]
    for s in range(offsets.shape[0]):
        offset = offsets[s]
        for k in range(wide):
            p[offset + k] = ahead[s, k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def correct_own(  # type: ignore[no-untyped-def]
    wide, p, base, calls, fading, offsets, rates, h, old, old_rate, work
):  # fmt: skip
    """Set every own state to its value at the end of the step; the rates there are known."""
    for s in range(offsets.shape[0]):
        offset, row = offsets[s], rates[s]
        if not fading[s]:
            for k in range(wide):
                p[row + k] = 0.5 * (old_rate[s, k] + p[row + k])
            continue
        for k in range(wide):
            both = abs(old_rate[s, k]) + abs(p[row + k])
            work[0, k] = h[k] * both + 1e-9 * abs(old[s, k]) + 1e-30
        own_slope(wide, p, base, s, calls, offset, row, work)
        for k in range(wide):
            first, second = phis(h[k] * work[1, k])
            begun = old_rate[s, k]
            ended = p[row + k] - work[1, k] * (p[offset + k] - old[s, k])
            p[row + k] = first * begun + second * (ended - begun)
    for s in range(offsets.shape[0]):
        offset, row = offsets[s], rates[s]
        for k in range(wide):
            p[offset + k] = old[s, k] + h[k] * p[row + k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def phis(z):  # type: ignore[no-untyped-def]
    """Return ``(exp(z) - 1) / z`` and ``(exp(z) - 1 - z) / z^2`` for z up to 0.

    Without a branch or a call of exp, which would keep loops from being vectorized: a series for
    z / 64, its argument doubled six times, as in `motor_sysid.physics.exponential`.
    """
    r = max(z, -_FAR) / 64.0
    second = 1.0 / 479001600.0
    for k in range(_TERMS):
        second = second * r + _SERIES[k]
    first = 1.0 + r * second
    for _ in range(6):
        second = 0.25 * first * first + 0.5 * second
        first *= 1.0 + 0.5 * r * first
        r *= 2.0
    far, away = z < -_FAR, -1.0 / min(z, -_FAR)
    return away if far else first, away * (1.0 - away) if far else second


@njit(cache=True, nogil=True, error_model='numpy')
def add_rate_laws(  # type: ignore[no-untyped-def]
    wide, p, base, x, u, linear, calls, forces, slope_rows, force_rows, own_state, work
):  # fmt: skip
    """Add the laws that read the rate of change of their own equation to the forces.

    Parameters
    ----------
    x, u:
        (n, W) core state, as loaded, and (n_u, W) input.
    linear:
        A (n, n, W), B (n, n_u, W), G (n, m, W) of the linear motor.
    calls, forces:
        (K, 3) addresses and offsets of the laws, and the equation of each.
    slope_rows:
        (m,) rows of the buffer in which laws find the rate of each equation's own state.
    work:
        (2, W) memory.
    """
    a, b, g = linear
    for i in range(calls.shape[0]):
        j = forces[i]
        at, row, slope = own_state[j], force_rows[j] * LANES, slope_rows[j] * LANES
        for k in range(wide):
            work[0, k] = 0.0
        for c in range(a.shape[1]):
            for k in range(wide):
                work[0, k] += a[at, c, k] * x[c, k]
        for c in range(b.shape[1]):
            for k in range(wide):
                work[0, k] += b[at, c, k] * u[c, k]
        for c in range(g.shape[1]):
            other = force_rows[c] * LANES
            for k in range(wide):
                work[0, k] += g[at, c, k] * p[other + k]
        for k in range(wide):
            work[1, k] = p[row + k]
            p[slope + k] = work[0, k]
        call_lane(calls[i, 0], base, calls[i, 1], calls[i, 2], wide)
        for k in range(wide):
            force = p[row + k] - work[1, k]
            left = work[0, k] - g[at, j, k] * force
            share = work[0, k] / left if left != 0.0 else 1.0
            p[row + k] = work[1, k] + force * share
