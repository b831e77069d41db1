"""Covariance of an estimate where the errors are stationary noise, however long correlated.

A sandwich of time blocks asks of every parameter that many blocks tell of it.  The moment of a
step is told by one, a constant load by all, but by each with noise that the next one shares: there
it says too little.  Here the noise is the same all the time, and its correlation is taken from
all of the residuals:

    S = sum over t, s of slope_t Gamma(t - s) slope_s^T,

with the lags of ``Gamma`` faded by Parzen's window.  (Priestley, Spectral Analysis and Time
Series, 1981, section 6.2.3; Newey and West 1987, doi:10.2307/1913610, for the sandwich.)
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from motor_sysid.estimation.batch.problem import Linearization, weighed
from motor_sysid.estimation.batch.weighting import Weighting

Array = NDArray[np.float64]

LAGS = 10
"""Part of the longest stretch over which errors may be correlated: one in so many."""


def stationary_scores(near: Sequence[Linearization], weighting: Weighting) -> Array:
    """Return the (d, d) covariance of the score at a solution.

    Parameters
    ----------
    near:
        Residuals and derivatives at the solution.
    weighting:
        Noise model of the fit.
    """
    outputs, size = near[0].residual.shape[1], near[0].slope.shape[2]
    parts = [rest.reshape(-1, outputs, size + 1) for rest in weighed(near, weighting)]
    gamma = _correlation([part[:, :, -1] for part in parts])
    total = np.zeros((size, size))
    for part in parts:
        total += _spread(part[:, :, :-1], gamma)
    return total * _freedom(gamma, sum(map(len, parts)), size)


def _correlation(errors: Sequence[Array]) -> Array:
    """Return (2 M + 1, n_y, n_y) covariances of (N, n_y) errors, lags -M to M, faded."""
    most = max(max(map(len, errors)) // LAGS, 1)
    count = sum(map(len, errors))
    length = next_fast_len(max(map(len, errors)) + most, real=True)
    spectrum = np.zeros((length // 2 + 1, *(errors[0].shape[1],) * 2), dtype=complex)
    for error in errors:
        waves = rfft(error, length, axis=0)
        spectrum += np.conj(waves)[:, :, np.newaxis] * waves[:, np.newaxis, :]
    found = irfft(spectrum, length, axis=0) / count
    lags = np.arange(-most, most + 1)
    x = np.abs(lags) / most
    window = np.where(x < 0.5, 1 - 6 * x**2 * (1 - x), 2 * (1 - x) ** 3)
    gamma: Array = found[lags] * window[:, np.newaxis, np.newaxis]
    return gamma


def _spread(slope: Array, gamma: Array) -> Array:
    """Return the (d, d) sum of products of (N, n_y, d) slopes, `gamma` between them."""
    most = len(gamma) // 2
    length = next_fast_len(len(slope) + 2 * most, real=True)
    noise = rfft(np.roll(np.pad(gamma, ((0, length - len(gamma)), (0, 0), (0, 0))), -most, axis=0),
                 axis=0)  # fmt: skip
    waves = rfft(slope, length, axis=0)
    coloured = irfft(np.einsum('fij,fjk->fik', np.conj(noise), waves), length, axis=0)
    flat = slope.reshape(-1, slope.shape[2])
    product: Array = flat.T @ coloured[: len(slope)].reshape(flat.shape)
    return 0.5 * (product + product.T)


def _freedom(gamma: Array, count: int, size: int) -> float:
    """Return what the fit took from the residuals: n / (n - d), n independent ones."""
    most = len(gamma) // 2
    longest = np.sum(np.einsum('tii->ti', gamma) ** 2, axis=0) / np.diag(gamma[most]) ** 2
    independent = count / float(np.max(longest))
    return independent / max(independent - size, 1.0)
