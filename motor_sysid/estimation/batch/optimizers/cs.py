"""Cuckoo search: Levy flights, and nests that are found.

By turns every nest tries ``x + 0.3 L (x - best)`` with steps L of a Levy flight, and a quarter of
the coordinates tries ``x + r (one - other)`` with two random nests; the better place stays.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Greedy, levy

Array = NDArray[np.float64]

_STEP, _FOUND = 0.3, 0.25


class Cuckoos(Greedy):
    """Levy flights and nests that are found, by turns."""

    title = 'cuckoo search'
    reference = 'Yang and Deb 2009, doi:10.1109/NABIC.2009.5393690'

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._flying = False

    def _trials(self) -> Array:
        x, self._flying = self._members, not self._flying
        if self._flying:
            step: Array = x + _STEP * levy(x.shape, self._rng) * (x - self.best)
            return step
        found = self._rng.random(x.shape) < _FOUND
        one, other = (x[self._rng.permutation(len(x))] for _ in range(2))
        moved: Array = x + found * self._rng.random((len(x), 1)) * (one - other)
        return moved
