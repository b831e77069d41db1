"""Grey wolf optimization.

Every wolf moves to the mean of three points, one for each of the best three found so far:

    x_l = leader - A |C leader - x|,  A = a (2 r1 - 1),  C = 2 r2,  a from 2 to 0.

The product C times leader makes the origin of the coordinates a place that wolves are drawn to.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer

Array = NDArray[np.float64]


class GreyWolves(Optimizer):
    """Wolves that follow the best three."""

    title = 'grey wolves'
    reference = 'Mirjalili et al. 2014, doi:10.1016/j.advengsoft.2013.12.007'
    follows_shifts = False

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._leaders = Leaders(dimension)

    def _move(self, costs: Array) -> Array:
        self._leaders.update(self._points, costs)
        return encircled(self._points, self._leaders.points, 2.0 * (1 - self.progress), self._rng)


class Leaders:
    """The best three points so far, (up to 3, d), and their costs."""

    def __init__(self, dimension: int) -> None:
        self.points, self.costs = np.zeros((0, dimension)), np.zeros(0)

    def update(self, points: Array, costs: Array) -> None:
        """Take (P, d) points with their costs into account."""
        everyone, known = np.vstack([self.points, points]), np.append(self.costs, costs)
        order = np.argsort(known, kind='stable')[:3]
        self.points, self.costs = everyone[order], known[order]


def encircled(points: Array, leaders: Array, a: float, rng: np.random.Generator) -> Array:
    """Return where (P, d) wolves go that follow (3, d) leaders."""
    r1, r2 = rng.random((2, len(leaders), *points.shape))
    chosen = leaders[:, np.newaxis, :]
    goals = chosen - a * (2.0 * r1 - 1.0) * np.abs(2.0 * r2 * chosen - points)
    where: Array = goals.mean(axis=0)
    return where
