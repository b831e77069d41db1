"""Matrix exponential and its two integrals for one substep of many small linear systems.

    E = exp(Ah),  phi1 = (E - 1) / Ah,  phi2 = (E - 1 - Ah) / (Ah)^2

phi2 is summed as a Taylor series of ``Z = Ah / 2^s`` with a norm below 1/4, phi1 = 1 + Z phi2 and
E = 1 + Z phi1 follow, and s doublings lead back (none of these cancels digits):

    phi2(2Z) = (phi1^2 + 2 phi2) / 4,  phi1(2Z) = (E + 1) phi1 / 2,  E(2Z) = E^2.

(Higham, Functions of Matrices, 2008, sections 10.7.4 and 10.5.)
"""

from numba import njit
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DEGREE = 9
_LARGEST_NORM = 1e12


@njit(cache=True, nogil=True, error_model='numpy')
def substep_matrices(a, b, g, h):  # type: ignore[no-untyped-def]
    """Return E, h phi1 B, h phi1 G and h phi2 G with the lane last.

    Parameters
    ----------
    a, b, g:
        (W, n, n), (W, n, k) and (W, n, m) arrays of W systems.
    h:
        (W,) length of the substep in s.

    Returns
    -------
    (n, n, W), (n, k, W), (n, m, W), (n, m, W) arrays; NaN in lanes whose matrix is not finite or
    so large that the motor of that lane makes no sense.
    """
    lanes, n = a.shape[0], a.shape[1]
    whole = np.empty((n, n, lanes))
    input_part = np.empty((n, b.shape[2], lanes))
    force_part = np.empty((n, g.shape[2], lanes))
    force_slope = np.empty((n, g.shape[2], lanes))
    z, e, p1, p2 = np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    work = np.empty((n, n))
    for lane in range(lanes):
        norm = 0.0
        for i in range(n):
            row = 0.0
            for j in range(n):
                z[i, j] = a[lane, i, j] * h[lane]
                row += abs(z[i, j])
            norm = max(norm, row)
            if row != row:
                norm = np.inf
        if not norm < _LARGEST_NORM:
            whole[:, :, lane] = np.nan
            input_part[:, :, lane] = np.nan
            force_part[:, :, lane] = np.nan
            force_slope[:, :, lane] = np.nan
            continue
        doublings = 0
        while norm > 0.25:
            norm *= 0.5
            doublings += 1
        scale = 0.5**doublings
        for i in range(n):
            for j in range(n):
                z[i, j] *= scale
        _series(z, p2, work)
        _one_plus_product(z, p2, p1)
        _one_plus_product(z, p1, e)
        for _ in range(doublings):
            _double(e, p1, p2, work)
        for i in range(n):
            for j in range(n):
                whole[i, j, lane] = e[i, j]
        _product(p1, b[lane], h[lane], input_part, lane)
        _product(p1, g[lane], h[lane], force_part, lane)
        _product(p2, g[lane], h[lane], force_slope, lane)
    return whole, input_part, force_part, force_slope


@njit(cache=True, nogil=True, error_model='numpy')
def _series(z, total, work):  # type: ignore[no-untyped-def]
    """Set `total` to sum over k of z^k / (k + 2)!, by Horner's rule."""
    n = z.shape[0]
    for i in range(n):
        for j in range(n):
            total[i, j] = 1.0 if i == j else 0.0
    for k in range(_DEGREE, 0, -1):
        factor = 1.0 / (k + 2)
        for i in range(n):
            for j in range(n):
                value = 0.0
                for m in range(n):
                    value += z[i, m] * total[m, j]
                work[i, j] = value * factor
        for i in range(n):
            for j in range(n):
                total[i, j] = work[i, j]
            total[i, i] += 1.0
    for i in range(n):
        for j in range(n):
            total[i, j] *= 0.5


@njit(cache=True, nogil=True, error_model='numpy')
def _one_plus_product(z, p, out):  # type: ignore[no-untyped-def]
    """Set `out` to 1 + z p."""
    n = z.shape[0]
    for i in range(n):
        for j in range(n):
            value = 1.0 if i == j else 0.0
            for m in range(n):
                value += z[i, m] * p[m, j]
            out[i, j] = value


@njit(cache=True, nogil=True, error_model='numpy')
def _double(e, p1, p2, work):  # type: ignore[no-untyped-def]
    """Go from Z to 2Z in place."""
    n = e.shape[0]
    for i in range(n):
        for j in range(n):
            value = 2.0 * p2[i, j]
            for m in range(n):
                value += p1[i, m] * p1[m, j]
            work[i, j] = 0.25 * value
    for i in range(n):
        for j in range(n):
            p2[i, j] = work[i, j]
            value = p1[i, j]
            for m in range(n):
                value += e[i, m] * p1[m, j]
            work[i, j] = 0.5 * value
    for i in range(n):
        for j in range(n):
            p1[i, j] = work[i, j]
    for i in range(n):
        for j in range(n):
            value = 0.0
            for m in range(n):
                value += e[i, m] * e[m, j]
            work[i, j] = value
    for i in range(n):
        for j in range(n):
            e[i, j] = work[i, j]


@njit(cache=True, nogil=True, error_model='numpy')
def _product(p, right, h, out, lane):  # type: ignore[no-untyped-def]
    """Set lane `lane` of `out` to h p right."""
    n = p.shape[0]
    for i in range(n):
        for j in range(right.shape[1]):
            value = 0.0
            for m in range(n):
                value += p[i, m] * right[m, j]
            out[i, j, lane] = h * value
