"""Fractional order, each power of s after Oustaloup.

    y = (b0 + b1 s^alpha) / (1 + a1 s^alpha + a2 s^(2 alpha)) u + constant + white noise

Inside a band, s^alpha is a chain of alternating zeros and poles whose gain rises by alpha decades
a decade.  (Oustaloup et al. 2000, doi:10.1109/81.817385; Monje et al., Fractional-order Systems
and Controls, 2010, section 12.1.)
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from motor_sysid.structures.base import Kind, Numbers, Run

Array = NDArray[np.float64]

_PAIRS = 7
_SLOWEST, _FASTEST = 2e-5, 3.0
_LOWER_ALPHA, _UPPER_ALPHA = 0.2, 1.0
_MOST = 40


class Fractional(Kind):
    """One or two fractional poles, 0.2 <= alpha <= 1."""

    key = 'fractional'
    title = 'fractional order'
    source = 'Oustaloup et al., IEEE Trans. Circuits and Systems I, 2000'
    limits = 'linear; a fractional power holds from 2e-5 to 3 rad per sample'
    orders = (1, 2)

    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Fit from a few exponents and time constants; see `Kind.fit`."""
        longest = 0.2 * max(len(run) for run in runs)
        grid = [
            np.concatenate(([alpha], alpha * np.log(t) * np.arange(1, order + 1)))
            for alpha in (0.5, 0.8, 0.98)
            for t in np.geomspace(1.0, longest, 5)
        ]

        def residual(z: Array) -> Array:
            return _projected(z, runs)[1]

        costs = [float(np.sum(residual(z) ** 2)) for z in grid]
        lower = np.concatenate(([_LOWER_ALPHA], np.full(order, -5.0)))
        upper = np.concatenate(([_UPPER_ALPHA], np.full(order, 40.0)))
        start = np.clip(grid[int(np.argmin(costs))], lower, upper)
        found = least_squares(
            residual, start, bounds=(lower, upper), max_nfev=_MOST,
            diff_step=np.full(start.size, 1e-4), xtol=1e-7, ftol=1e-8,
        )  # fmt: skip
        best = np.asarray(found.x)
        return {'shape': best, 'gain': _projected(best, runs)[0]}

    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Run freely from rest: its memory is too long to read a start; see `Kind.simulate`."""
        return (_responses(numbers['shape'], u) @ numbers['gain'])[:, np.newaxis]


def oustaloup(alpha: float) -> tuple[Array, Array, float]:
    """Return zeros, poles (rad per sample, positive) and gain of ``s^alpha`` in the band."""
    ratio = _FASTEST / _SLOWEST
    k = np.arange(_PAIRS)
    zeros = _SLOWEST * ratio ** ((k + 0.5 * (1 - alpha)) / _PAIRS)
    poles = _SLOWEST * ratio ** ((k + 0.5 * (1 + alpha)) / _PAIRS)
    return zeros, poles, float(_FASTEST**alpha)


def modes(shape: Array) -> tuple[Array, Array]:
    """Return poles (rad per sample) and residues of ``s^(k alpha) / (1 + a1 s^alpha + ...)``.

    The residues are (order, R): one row for each numerator, k < order.

    Parameters
    ----------
    shape:
        (order + 1,) alpha and the logarithms of the a, for time in samples.
    """
    zeros, poles, gain = oustaloup(float(shape[0]))
    middle = np.sqrt(_SLOWEST * _FASTEST)
    up = np.asarray(gain * np.poly(-zeros / middle), dtype=np.float64)
    down = np.asarray(np.poly(-poles / middle), dtype=np.float64)
    order = shape.size - 1
    terms = [_product([up] * k + [down] * (order - k)) for k in range(order + 1)]
    factors = np.concatenate(([1.0], np.exp(shape[1:])))
    whole = np.sum([f * term for f, term in zip(factors, terms, strict=True)], axis=0)
    roots = np.roots(whole)
    slope = np.polyval(np.polyder(whole), roots)
    residues = [factors[k] * np.polyval(terms[k], roots) / slope for k in range(order)]
    return roots * middle, np.array(residues) * middle


def _product(factors: Sequence[Array]) -> Array:
    whole = np.ones(1)
    for factor in factors:
        whole = np.convolve(whole, factor)
    return whole


def _responses(shape: Array, u: Array) -> Array:
    """Return (N, order m + 1) responses of every input (N, m), and ones."""
    rates, residues = modes(shape)
    with np.errstate(over='ignore'):
        keep = np.exp(np.minimum(rates.real, 0.0) + 1j * rates.imag)
    push = (keep - 1) / rates
    columns = []
    for column in u.T:
        parts = [lfilter([0.0, b], [1.0, -a], column) for a, b in zip(keep, push, strict=True)]
        columns += list(np.real(residues @ np.array(parts)))
    return np.column_stack([*columns, np.ones(len(u))])


def _projected(shape: Array, runs: Sequence[Run]) -> tuple[Array, Array]:
    x = np.concatenate([_responses(shape, run.u) for run in runs])
    y = np.concatenate([run.y[:, 0] for run in runs])
    gain = np.linalg.lstsq(x.T @ x, x.T @ y, rcond=1e-12)[0]
    return gain, y - x @ gain
