"""Regression on what equations lack, with the base parameters' share taken out of both sides."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d
from scipy.stats import t as student

from motor_sysid.diagnosis.where.unexplained import KERNEL, Lack, Share, WINDOW
from motor_sysid.physics.model import Model, SpeedSensor

Array = NDArray[np.float64]
Parts = Sequence[Array]

MOST = 8000
"""Rows that are enough; there is no more than one for half a smoothing window."""

BLOCKS = 200
FOLDS = 10
"""Blocks of time, dealt to the folds in turn, so that every fold sees all of the record."""

RIDGE = 1e-6

_SMOOTH = np.convolve(KERNEL, [0.5, 0.5])


@dataclass(frozen=True)
class Rows:
    """Thinned samples of one equation's lacking force.

    Attributes
    ----------
    force:
        Equation.
    target:
        (K,) lacking force in N m or V, beyond the base parameters.
    basis:
        (K, p) this equation's part of what base parameters can do in all equations together.
    block:
        (K,) block of time of each row.
    sizes:
        Samples of each record before thinning.
    noise:
        Variance that sensor noise alone makes of the force.
    every:
        Samples between two rows.
    """

    force: str
    target: Array
    basis: Array
    block: NDArray[np.intp]
    sizes: tuple[int, ...]
    noise: float
    every: int

    @property
    def power(self) -> float:
        """Mean square of what is lacking."""
        return float(np.mean(self.target**2))

    def take(self, parts: Parts) -> Array:
        """Return the rows of (N, k) columns over the records, smoothed as the force is."""
        return np.concatenate([convolve1d(part, _SMOOTH, axis=0)[:: self.every] for part in parts])

    def thin(self, parts: Parts) -> Array:
        """Return the (K,) values at the rows of (N,) ones over the records."""
        return np.concatenate([part[:: self.every] for part in parts])

    def split(self, joined: Array) -> list[Array]:
        """Return (N,) values over the records, one array for each."""
        return np.split(joined, np.cumsum(self.sizes)[:-1])

    def beyond(self, columns: Array) -> Array:
        """Return (K, k) columns without what base parameters can do."""
        return np.asarray(columns - self.basis @ (self.basis.T @ columns), dtype=np.float64)

    def predicted(self, columns: Array) -> Array:
        """Return (K,) what a regression on the columns predicts in blocks that it has not seen."""
        raw = self.beyond(columns)
        size = np.maximum(np.sqrt(np.mean(raw**2, axis=0)), 1e-300)
        x = np.asarray(raw / size, dtype=np.float64)
        fold = self.block % FOLDS
        grams = [x[fold == k].T @ x[fold == k] for k in range(FOLDS)]
        sides = [x[fold == k].T @ self.target[fold == k] for k in range(FOLDS)]
        gram, side = np.sum(grams, axis=0), np.sum(sides, axis=0)
        ridge = RIDGE * len(x) * np.eye(x.shape[1])
        guess = np.zeros_like(self.target)
        for k in range(FOLDS):
            weights = np.linalg.solve(gram - grams[k] + ridge, side - sides[k])
            guess[fold == k] = x[fold == k] @ weights
        return guess

    def jackknife(self, columns: Array) -> tuple[Array, Array]:
        """Return the coefficients of a regression, and half widths of their 95 % bands.

        The bands come from leaving out one fold of blocks at a time (Efron's jackknife).
        """
        x = self.beyond(columns)
        fold = self.block % FOLDS
        left_out = np.stack(
            [np.linalg.lstsq(x[fold != k], self.target[fold != k], rcond=1e-9)[0]
             for k in range(FOLDS)]
        )  # fmt: skip
        spread = np.sqrt((FOLDS - 1) * np.mean((left_out - left_out.mean(axis=0)) ** 2, axis=0))
        band = student.ppf(0.975, FOLDS - 1) * spread
        return left_out.mean(axis=0), np.asarray(band, dtype=np.float64)

    def fitted(self, columns: Array) -> tuple[Array, float]:
        """Return the coefficients of a regression on all rows, and the mean square it leaves."""
        x = self.beyond(columns)
        coefficients = np.asarray(np.linalg.lstsq(x, self.target, rcond=1e-9)[0], np.float64)
        return coefficients, float(np.mean((self.target - x @ coefficients) ** 2))

    def explained(self, guess: Array) -> tuple[float, float]:
        """Return the mean square that a guess explains, and its gain over its standard error."""
        gain = self.target**2 - (self.target - guess) ** 2
        count = np.bincount(self.block)
        sums = np.bincount(self.block, weights=gain)[count > 0]
        spread = float(np.std(sums, ddof=1) * np.sqrt(sums.size)) if sums.size > 1 else np.inf
        return float(np.mean(gain)), float(np.sum(sums)) / max(spread, 1e-300)


def rows_of(
    model: Model, lacks: Sequence[Lack], share: Share, dt: float, sigmas: Mapping[str, float]
) -> list[Rows]:
    """Return the rows of each equation whose lack is known.

    `lacks` is what it lacks beyond the base parameters, whose `share` was taken out; `dt` is the
    sample time in s, `sigmas` output to the standard deviation of its sensor noise.
    """
    return [
        _rows(name, lacks, share, _noise(model, name, dt, sigmas)) for name in share.names
    ]


def _rows(name: str, lacks: Sequence[Lack], share: Share, noise: float) -> Rows:
    sizes = tuple(one.forces[name].size for one in lacks)
    first = share.names.index(name) * sum(sizes)
    parts = np.split(share.basis[first : first + sum(sizes)], np.cumsum(sizes)[:-1])
    every = max(WINDOW // 2, sum(sizes) // MOST)
    target = np.concatenate([one.forces[name][::every] for one in lacks])
    basis = np.sqrt(every) * np.concatenate([part[::every] for part in parts])
    block = np.arange(target.size) * BLOCKS // target.size
    return Rows(name, target, basis, block, sizes, noise, every)


def _noise(model: Model, force: str, dt: float, sigmas: Mapping[str, float]) -> float:
    """Return the variance of the lacking force that white sensor noise makes."""
    values = {name: np.array([v]) for name, v in model.parameters.values().items()}
    a, _, g = (matrix[0] for matrix in model.kind.matrices(values))
    column = [f.name for f in model.kind.forces].index(force)
    own = model.kind.forces[column].own_state
    row = model.kind.states.index(own)
    slope, middle = np.convolve(KERNEL, [1.0, -1.0]) / dt, np.convolve(KERNEL, [0.5, 0.5])
    total = 0.0
    for output in model.kind.outputs:
        if output.signal not in sigmas:
            continue
        path = -a[row, model.kind.states.index(output.state)] * middle
        if output.state == own:
            path = path + slope
        elif output.state == 'theta' and own == 'omega' and 'speed' not in sigmas:
            path = np.convolve(slope - a[row, row] * middle, [0.5, 0.0, -0.5]) / dt
        if output.signal == 'speed' and model.speed_sensor is SpeedSensor.DIFFERENCE:
            path = np.convolve(path, [0.5, 0.0, -0.5]) / np.sqrt(2)
        total += sigmas[output.signal] ** 2 * float(np.sum(path**2))
    return total / float(g[row, column]) ** 2
