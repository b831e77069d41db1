"""Sine cosine algorithm: waves around the best that die out.

    x + a sin(r) |c best - x|   or   x + a cos(r) |c best - x|,   a from 2 to 0,

with r uniform over a turn, c between 0 and 2, and even odds, new for every coordinate.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer

Array = NDArray[np.float64]


class SineCosine(Optimizer):
    """Waves around the best."""

    title = 'sine cosine'
    reference = 'Mirjalili 2016, doi:10.1016/j.knosys.2015.12.022'
    follows_shifts = False

    def _move(self, costs: Array) -> Array:
        return waved(self._points, self.best, 2.0 * (1 - self.progress), self._rng)


def waved(points: Array, best: Array, size: float, rng: np.random.Generator) -> Array:
    """Return (P, d) points after a wave of the given size around the best (d,)."""
    angle, weight, choice = rng.random((3, *points.shape))
    wave = np.where(choice < 0.5, np.sin(2 * np.pi * angle), np.cos(2 * np.pi * angle))
    moved: Array = points + size * wave * np.abs(2 * weight * best - points)
    return moved
