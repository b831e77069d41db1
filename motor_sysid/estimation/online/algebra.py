"""The small matrix algebra of a filter, compiled: calls of numpy would cost more than it."""

import numpy as np

from motor_sysid.machine_code import kept

# The filter's state is (motor state n, moved parameters p, offsets); only the first n move.


@kept(error_model='numpy')
def propagate(p, slope, kick, wander, most, h):  # type: ignore[no-untyped-def]
    """Return F P F' + Q, symmetric.

    Parameters
    ----------
    p:
        (d, d) covariance.
    slope:
        (n, n + k) upper part of F, by states and parameters; the rest of F is the identity.
    kick:
        (n, m) change of the state by the unexplained forces, one standard deviation each.
    wander:
        (d - n,) variance by which parameters and offsets wander in a second,
    most:
        (d - n,) standard deviation beyond which they do not.
    h:
        Length of the sample in s.
    """
    d, n, moved = p.shape[0], slope.shape[0], slope.shape[1]
    rows = np.empty((n, d))
    for i in range(n):
        for j in range(d):
            value = 0.0
            for m in range(moved):
                value += slope[i, m] * p[m, j]
            rows[i, j] = value
    out = p.copy()
    for i in range(n):
        for j in range(n, d):
            out[i, j] = rows[i, j]
            out[j, i] = rows[i, j]
        for j in range(i + 1):
            value = 0.0
            for m in range(moved):
                value += rows[i, m] * slope[j, m]
            for m in range(kick.shape[1]):
                value += kick[i, m] * kick[j, m]
            out[i, j] = value
            out[j, i] = value
    for i in range(n, d):
        room = 1.0 - p[i, i] / most[i - n] ** 2
        out[i, i] += wander[i - n] * h * max(room, 0.0)
    return out


@kept(error_model='numpy')
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


@kept(error_model='numpy')
def solve_upper(upper, right):  # type: ignore[no-untyped-def]
    """Return U^-1 B (d, k) for an upper triangular U (d, d); LAPACK's threads cost far more."""
    d, k = right.shape
    found = np.empty((d, k))
    for i in range(d - 1, -1, -1):
        for j in range(k):
            value = right[i, j]
            for m in range(i + 1, d):
                value -= upper[i, m] * found[m, j]
            found[i, j] = value / upper[i, i]
    return found


@kept(error_model='numpy')
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


@kept(error_model='numpy')
def widen(p, prior, factor):  # type: ignore[no-untyped-def]
    """Raise the covariance (d, d) by a factor, in place, but that of no parameter above its prior.

    `prior` (q,) are the standard deviations of the last q entries before any data.
    """
    d, first = p.shape[0], p.shape[0] - prior.size
    scale = np.full(d, np.sqrt(factor))
    for i in range(first, d):
        scale[i] /= np.sqrt(max(factor * p[i, i] / prior[i - first] ** 2, 1.0))
    for i in range(d):
        for j in range(d):
            p[i, j] *= scale[i] * scale[j]


@kept(error_model='numpy')
def joseph(x, p, z, rows, noise):  # type: ignore[no-untyped-def]
    """Take a measurement: return the state and its covariance after it.

    Joseph's form ``P' = (I - K H) P (I - K H)' + K R K'`` keeps the covariance positive whatever
    the rounding.  (Bucy and Joseph, Filtering for Stochastic Processes, 1968.)

    Parameters
    ----------
    x, p:
        (d,) state, (d, d) covariance.
    z, rows, noise:
        (k,) measurements, (k, d) rows H of the state, (k,) noise variances.
    """
    cross, spread = project(p, rows)
    k, d = rows.shape
    for i in range(k):
        spread[i, i] += noise[i]
    gain = cross @ np.linalg.inv(spread)
    after, left = x.copy(), np.eye(d)
    for j in range(k):
        innovation = z[j]
        for m in range(d):
            innovation -= rows[j, m] * x[m]
        for i in range(d):
            after[i] += gain[i, j] * innovation
            for m in range(d):
                left[i, m] -= gain[i, j] * rows[j, m]
    whole = left @ p @ left.T
    for i in range(d):
        for m in range(d):
            for j in range(k):
                whole[i, m] += gain[i, j] * noise[j] * gain[m, j]
    return after, whole


@kept(error_model='numpy')
def settle(x, p, lower, upper):  # type: ignore[no-untyped-def]
    """Make the covariance (d, d) symmetric and keep the last entries of the state in their box."""
    d, first = x.size, x.size - lower.size
    for i in range(d):
        for j in range(i):
            p[i, j] = 0.5 * (p[i, j] + p[j, i])
            p[j, i] = p[i, j]
    for i in range(first, d):
        x[i] = min(max(x[i], lower[i - first]), upper[i - first])
