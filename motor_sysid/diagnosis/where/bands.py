"""Means in bins with a band: how far noise alone, correlated in time, could carry them.

A bin's mean is a sum over the moments at which the motor was in that bin.  Its variance is taken
twice: from what the bin itself shows (a heteroskedasticity and autocorrelation consistent sum:
Newey and West 1987, with Andrews' 1991 choice of the bandwidth), and from one stationary noise
behind all bins.  The first is right where a bin was visited often, the second where it was not;
they are mixed by the number of independent visits.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft
from scipy.stats import t as student

Array = NDArray[np.float64]
Bins = NDArray[np.intp]

SHORTEST, MOST_BLOCKS = 3, 5000
"""Samples that are summed before anything else, at least; and blocks that are enough."""

FEWEST = 12
"""Samples that a bin needs."""

LEAST_VISITS = 2.0
"""Independent samples that a bin needs; with fewer nothing can be said."""

PRIOR = 30.0
"""Independent samples that the stationary noise counts for."""

WIDER = 2.0
"""Bandwidth in units of Andrews': a wider window is less biased."""

LEAST_LEFT = 0.2
"""Least share of a variance that is believed to be left after a bin's mean was taken out."""

LEVEL = 0.975


@dataclass(frozen=True)
class Binned:
    """Means in B bins.

    Attributes
    ----------
    mean, sigma, band:
        (B,) mean, its standard error, and half width of its 95 % band; NaN where the bin holds too
        little.
    freedom:
        (B,) degrees of freedom of `sigma`.
    count:
        (B,) samples.
    """

    mean: Array
    sigma: Array
    band: Array
    freedom: Array
    count: Array

    def chance(self, level: float = 0.0) -> float:
        """Return how probable it is that noise carries some bin as far from `level` as seen.

        The bins are taken together (Sidak), so that many bins do not make noise look like
        structure.  Against a level that is not 0, means are of squares and are compared by
        their logarithms.  NaN where no bin has a band.
        """
        known = np.isfinite(self.sigma) & (self.sigma > 0) & (self.mean > 0 if level else True)
        if not np.any(known):
            return float('nan')
        mean, sigma = self.mean[known], self.sigma[known]
        away = np.abs(np.log(mean / level)) * mean / sigma if level else np.abs(mean) / sigma
        least = float(np.min(2 * student.sf(away, self.freedom[known])))
        return float(-np.expm1(np.sum(known) * np.log1p(-min(least, 1 - 1e-16))))


def bin_means(places: Sequence[Bins], values: Sequence[Array], count: int) -> Binned:
    """Average values in bins.

    Parameters
    ----------
    places:
        For each record the (N,) bin of each sample; negative for none.
    values:
        For each record (N,) values, uniform in time.
    count:
        B, the number of bins.
    """
    totals, numbers = _blocks(places, values, count)
    number = numbers.sum(axis=0)
    with np.errstate(invalid='ignore', divide='ignore'):
        mean = totals.sum(axis=0) / number
    scores = totals - numbers * np.nan_to_num(mean)
    per_block = numbers.sum(axis=1)
    noise: Array = scores.sum(axis=1) / np.maximum(per_block, 1.0)
    width = _bandwidth(noise[per_block > 0])
    own, pooled, visits = _variances(scores, numbers, noise, per_block > 0, width)
    known = (number >= FEWEST) & (visits >= LEAST_VISITS)
    with np.errstate(invalid='ignore', divide='ignore'):
        mixed = (visits * own + PRIOR * pooled) / (visits + PRIOR)
        sigma = np.where(known, np.sqrt(mixed) / number, np.nan)
    freedom = np.maximum(visits, 1.0) / WIDER + PRIOR
    band = student.ppf(LEVEL, freedom) * sigma
    return Binned(np.where(known, mean, np.nan), sigma, band, freedom, number)


def _blocks(
    places: Sequence[Bins], values: Sequence[Array], count: int
) -> tuple[Array, Array]:
    """Return sums and numbers of samples (J, B) of each block in each bin."""
    block = max(SHORTEST, sum(p.size for p in places) // MOST_BLOCKS)
    totals, numbers = [], []
    for place, value in zip(places, values, strict=True):
        good = (place >= 0) & np.isfinite(value)
        rows = -(-place.size // block)
        cell = (np.arange(place.size) // block * count + place)[good]
        size = rows * count
        totals.append(np.bincount(cell, value[good], size).reshape(rows, count))
        numbers.append(np.bincount(cell, minlength=size).reshape(rows, count).astype(np.float64))
    return np.concatenate(totals), np.concatenate(numbers)


def _bandwidth(noise: Array) -> float:
    """Return Andrews' bandwidth in blocks for a Bartlett window, from a first-order model."""
    if noise.size < 8 or not np.any(noise):
        return 1.0
    rho = float(np.clip(np.sum(noise[1:] * noise[:-1]) / np.sum(noise**2), -0.97, 0.97))
    alpha = 4 * rho**2 / ((1 - rho) ** 2 * (1 + rho) ** 2)
    return float(np.clip(1.1447 * (alpha * noise.size) ** (1 / 3), 1.0, noise.size / 8))


def _variances(
    scores: Array, numbers: Array, noise: Array, used: NDArray[np.bool_], width: float
) -> tuple[Array, Array, Array]:
    """Return the variance of each bin's sum (own, and of stationary noise), and its visits.

    Both sums over lags are taken in the frequency domain: the spectrum of the scores (or of the
    numbers) times that of the lag window (or of the noise's windowed autocovariance).  Each bin's
    own mean has been taken out and has taken with it what is slower than the window lets pass:
    of a sum over n samples the share of their pairs that the window holds is lost.
    """
    lags = int(min(np.ceil(WIDER * width), len(scores) - 1))
    size = next_fast_len(len(scores) + lags + 1, real=True)
    window = np.maximum(1 - np.arange(lags + 1) / (WIDER * width + 1), 0.0)
    spectrum = np.abs(np.fft.rfft(noise, size)) ** 2
    covariance = np.fft.irfft(spectrum, size)[: lags + 1] / max(int(np.sum(used)), 1)
    filled = np.any(numbers > 0, axis=0)
    count = numbers[:, filled].sum(axis=0)
    pairs, sums = _weighted(numbers[:, filled], size, window, window * covariance)
    left = 1 - pairs / count**2
    own, pooled, visits = np.zeros((3, scores.shape[1]))
    own[filled] = _weighted(scores[:, filled], size, window)[0] / np.maximum(left, LEAST_LEFT)
    pooled[filled] = sums / max(float(np.average(left, weights=count)), LEAST_LEFT)
    square = max(float(covariance[0]), 1e-300)
    visits[filled] = count**2 * square / np.maximum(pooled[filled], 1e-300)
    return np.maximum(own, 0.0), np.maximum(pooled, 0.0), np.where(pooled > 0, visits, 0.0)


def _weighted(rows: Array, size: int, *windows: Array) -> list[Array]:
    """Return, for each window, each column's sum over lags of weight times autocorrelation."""
    wave = rfft(np.ascontiguousarray(rows.T), size, axis=1)
    power = wave.real**2 + wave.imag**2
    both = np.full(power.shape[1], 2.0)
    both[0] = 1.0
    if size % 2 == 0:
        both[-1] = 1.0
    sums = []
    for weights in windows:
        window = np.zeros(size)
        window[: weights.size] = weights
        window[size - weights.size + 1 :] = weights[:0:-1]
        sums.append(np.asarray(power @ (both * np.fft.rfft(window).real) / size))
    return sums
