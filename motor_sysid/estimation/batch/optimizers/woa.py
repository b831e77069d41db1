"""Whale optimization: whales encircle the best, spiral in on it, or follow another one.

With A = a (2 r - 1), C = 2 r' and a from 2 to 0, half of the moves are ``y - A |C y - x|``, where
y is the best, or a random whale if |A| is 1 or more; the other half are the spiral ``|best - x|
e^l cos(2 pi l) + best`` with l uniform between -1 and 1.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer

Array = NDArray[np.float64]


class Whales(Optimizer):
    """Whales around the best."""

    title = 'whales'
    reference = 'Mirjalili and Lewis 2016, doi:10.1016/j.advengsoft.2016.01.008'
    follows_shifts = False

    def _move(self, costs: Array) -> Array:
        x, count = self._points, costs.size
        r, c, way = self._rng.random((3, count, 1))
        reach = 2.0 * (1 - self.progress) * (2 * r - 1)
        whale = x[self._rng.integers(count, size=count)]
        goal = np.where(np.abs(reach) < 1, self.best, whale)
        circle = goal - reach * np.abs(2 * c * goal - x)
        turn = self._rng.uniform(-1, 1, (count, 1))
        spiral = np.abs(self.best - x) * np.exp(turn) * np.cos(2 * np.pi * turn) + self.best
        moved: Array = np.where(way < 0.5, circle, spiral)
        return moved
