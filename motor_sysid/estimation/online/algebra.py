"""The small matrix algebra of a filter, compiled: calls of numpy would cost more than it."""

from numba import njit
import numpy as np

# The filter's state is (motor state n, moved parameters p, offsets); only the first n move.


@njit(cache=True, error_model='numpy')
def propagate(p, by_state, by_parameter, kick, wander, most, h):  # type: ignore[no-untyped-def]
    """Return F P F' + Q, symmetric.

    Parameters
    ----------
    p:
        (d, d) covariance.
    by_state, by_parameter:
        (n, n), (n, k) upper blocks of F; the rest of F is the identity.
    kick:
        (n, m) change of the state by the unexplained forces, one standard deviation each.
    wander:
        (d - n,) variance by which parameters and offsets wander in a second,
    most:
        (d - n,) standard deviation beyond which they do not.
    h:
        Length of the sample in s.
    """
    d, n, k = p.shape[0], by_state.shape[0], by_parameter.shape[1]
    rows = np.empty((n, d))
    for i in range(n):
        for j in range(d):
            value = 0.0
            for m in range(n):
                value += by_state[i, m] * p[m, j]
            for m in range(k):
                value += by_parameter[i, m] * p[n + m, j]
            rows[i, j] = value
    out = p.copy()
    for i in range(n):
        for j in range(n, d):
            out[i, j] = rows[i, j]
            out[j, i] = rows[i, j]
        for j in range(i + 1):
            value = 0.0
            for m in range(n):
                value += rows[i, m] * by_state[j, m]
            for m in range(k):
                value += rows[i, n + m] * by_parameter[j, m]
            for m in range(kick.shape[1]):
                value += kick[i, m] * kick[j, m]
            out[i, j] = value
            out[j, i] = value
    for i in range(n, d):
        room = 1.0 - p[i, i] / most[i - n] ** 2
        out[i, i] += wander[i - n] * h * max(room, 0.0)
    return out


@njit(cache=True, error_model='numpy')
def project(p, rows):  # type: ignore[no-untyped-def]
    """Return P H' (d, k) and H P H' (k, k) for rows H (k, d)."""
    d, k = p.shape[0], rows.shape[0]
    cross, spread = np.zeros((d, k)), np.zeros((k, k))
    for j in range(k):
        for m in range(d):
            if rows[j, m] != 0.0:
                for i in range(d):
                    cross[i, j] += p[i, m] * rows[j, m]
    for i in range(k):
        for j in range(k):
            for m in range(d):
                spread[i, j] += rows[i, m] * cross[m, j]
    return cross, spread


@njit(cache=True, error_model='numpy')
def largest_stride(cross, total, innovation, stride):  # type: ignore[no-untyped-def]
    """Return the largest move of a parameter in units of its stride, at least 1.

    Parameters
    ----------
    cross, total, innovation:
        (d, k) covariance of state and innovation, (k, k) variance of the innovation, (k,).
    stride:
        (q,) allowed move of the last q entries of the state.
    """
    weight = np.linalg.solve(total, innovation)
    first = cross.shape[0] - stride.size
    ratio = 1.0
    for i in range(stride.size):
        move = 0.0
        for j in range(weight.size):
            move += cross[first + i, j] * weight[j]
        ratio = max(ratio, abs(move) / stride[i])
    return ratio
