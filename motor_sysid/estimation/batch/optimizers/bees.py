"""Artificial bee colony: sources of food, looked at by employed bees and by onlookers.

A look changes one coordinate of a source, ``x_j + phi (x_j - other_j)`` with phi uniform between
-1 and 1, and a better place replaces the source.  Employed bees look once at every source,
onlookers at those they choose; they choose by rank, so that the size of costs does not matter.  A
source that was no better after as many looks as the colony has coordinates is given up for a
random one.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer, others

Array = NDArray[np.float64]


class Bees(Optimizer):
    """Employed bees, onlookers and scouts."""

    title = 'artificial bee colony'
    reference = 'Karaboga and Basturk 2007, doi:10.1007/s10898-007-9149-x'

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._sources, self._costs = self._points.copy(), np.full(population, np.inf)
        self._looks = np.zeros(population)
        self._seen = np.arange(population)
        self._limit, self._employed = population * dimension, False

    def _move(self, costs: Array) -> Array:
        for k in np.argsort(-costs, kind='stable'):  # the best look at a source comes last
            source = self._seen[k]
            if costs[k] <= self._costs[source]:
                self._sources[source], self._costs[source] = self._points[k], costs[k]
                self._looks[source] = 0
            else:
                self._looks[source] += 1
        self._employed = not self._employed
        return self._employ() if self._employed else self._watch()

    def _employ(self) -> Array:
        self._seen = np.arange(len(self._sources))
        points = self._looked()
        tired = int(np.argmax(self._looks))
        if self._looks[tired] > self._limit:
            points[tired] = self._rng.uniform(-1, 1, points.shape[1])
            self._costs[tired], self._looks[tired] = np.inf, 0
        return points

    def _watch(self) -> Array:
        count = len(self._sources)
        rank = np.argsort(np.argsort(self._costs, kind='stable'), kind='stable')
        chance = (count - rank) / np.sum(count - rank)
        self._seen = self._rng.choice(count, size=count, p=chance)
        return self._looked()

    def _looked(self) -> Array:
        """Return a look near each source that is `_seen`."""
        count, d = self._sources.shape
        points = self._sources[self._seen]
        other = self._sources[others(count, 1, self._rng)[0][self._seen]]
        row, j = np.arange(count), self._rng.integers(d, size=count)
        phi = self._rng.uniform(-1, 1, count)
        points[row, j] += phi * (points[row, j] - other[row, j])
        return points
