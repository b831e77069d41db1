"""The bat algorithm as the paper prints it, to show what the sign does; nobody should use it.

    v <- v + f (x - best),   x <- x + v,   f uniform between 0 and 1

which doubles the distance to the best at every step for f = 1/2; local steps ``best + A e`` with e
uniform between -1 and 1 are not scaled by the box; loudness and pulse rate stay at 0.5.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer

Array = NDArray[np.float64]

_LOUDNESS, _RATE = 0.5, 0.5


class PrintedBats(Optimizer):
    """Bats that flee from the best one."""

    title = 'bats as printed'
    reference = 'equations (44) to (48) of the paper, after Yang 2010'

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._members, self._costs = self._points.copy(), np.full(population, np.inf)
        self._velocity = np.zeros((population, dimension))

    def _move(self, costs: Array) -> Array:
        taken = (costs <= self._costs) & (self._rng.random(costs.size) < _LOUDNESS)
        taken |= ~np.isfinite(self._costs)
        self._members[taken], self._costs[taken] = self._points[taken], costs[taken]
        pitch = self._rng.random((costs.size, 1))
        self._velocity += pitch * (self._members - self.best)
        local = self._rng.random((costs.size, 1)) > _RATE
        near = self.best + _LOUDNESS * self._rng.uniform(-1, 1, self._members.shape)
        return np.where(local, near, self._members + self._velocity)
