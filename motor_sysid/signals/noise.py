"""How much of a measured signal is sensor noise, read from the signal itself."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_coeffs
from scipy.stats import chi2

from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

_WINDOW = 9
_DEGREE = 3
_BLOCK = 27
_QUANTILE = 0.25


def noise_sigma(values: Array, *, differenced: bool = False) -> float:
    """Estimate the standard deviation of the fast noise on a smooth signal.

    A cubic is fitted around every sample; what it leaves, corrected for what it takes of noise
    with that spectrum, is the noise.  Of the powers in short blocks a low quantile is taken (and
    corrected for being low), so that steps and transients stay out.

    Parameters
    ----------
    values:
        (N,) uniformly sampled signal.
    differenced:
        Whether the noise is white noise differenced over one sample, as on a speed that is taken
        from encoder counts.
    """
    if values.size < 4 * _WINDOW:
        return float(np.std(np.diff(values)) / np.sqrt(2)) if values.size > 2 else 0.0
    left, shape = _beside_cubics(values, differenced)
    spectrum = np.abs(np.fft.rfft(shape, 512)) ** 2
    freedom = _BLOCK * np.mean(spectrum) ** 2 / np.mean(spectrum**2)
    edges = np.linspace(0, left.size, left.size // _BLOCK + 1).astype(int)
    power = np.add.reduceat(left**2, edges[:-1]) / np.diff(edges)
    moving = power[power > 1e-3 * np.median(power)]
    if moving.size == 0:
        return 0.0
    low = chi2.ppf(_QUANTILE, freedom) / freedom
    return float(np.sqrt(np.quantile(moving, _QUANTILE) / low / np.sum(shape**2)))


def fast_part(values: Array, *, differenced: bool = False) -> Array:
    """Return what is fast in (N,) values, as large as the white noise would be that made it.

    That noise is differenced over one sample, if so told.  (N - 8,), or (N,) of few values.
    """
    if values.size < 4 * _WINDOW:
        return values - np.mean(values)
    left, shape = _beside_cubics(values, differenced)
    fast: Array = left / np.sqrt(np.sum(shape**2))
    return fast


def _beside_cubics(values: Array, differenced: bool) -> tuple[Array, Array]:
    """Return what cubics leave of (N,) values, and which sum of white noise that would be."""
    kernel = -savgol_coeffs(_WINDOW, _DEGREE)
    kernel[_WINDOW // 2] += 1.0
    left = np.convolve(values, kernel, mode='valid')
    return left, np.convolve(kernel, [1.0, -1.0]) / np.sqrt(2) if differenced else kernel


def noise_sigmas(parts: Sequence[Array], differenced: Sequence[bool]) -> Array:
    """Return (n_y,) noise of the columns of several stretches (N, n_y), the median over them."""
    return np.array(
        [
            np.median([noise_sigma(part[:, j], differenced=late) for part in parts])
            for j, late in enumerate(differenced)
        ]
    )


def rounding_sigmas(records: Sequence[Record], names: Sequence[str]) -> Array:
    """Return (n_y,) noise that the steps of quantized signals make at least, or zero.

    The error of rounding is spread evenly over a step; the coarsest record counts.
    """
    steps = [
        max((record.step_of(name) for record in records if name in record), default=0.0)
        for name in names
    ]
    rounding: Array = np.array(steps) / np.sqrt(12)
    return rounding
