"""Ant colony for continuous spaces: an archive of good places is the pheromone.

Every ant chooses one of the archive's places by rank (weights of a normal law of width q = 0.1
over the ranks) and draws around it with a width of ``0.85`` times the mean distance of the
others.  The archive keeps the best of old and new.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer

Array = NDArray[np.float64]

_LOCALITY, _EVAPORATION = 0.1, 0.85


class Ants(Optimizer):
    """Draws around the places of an archive (ACO_R)."""

    title = 'ant colony for continuous spaces'
    reference = 'Socha and Dorigo 2008, doi:10.1016/j.ejor.2006.06.046'

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._archive, self._costs = np.zeros((0, dimension)), np.zeros(0)

    def _move(self, costs: Array) -> Array:
        count = costs.size
        everyone, known = np.vstack([self._archive, self._points]), np.append(self._costs, costs)
        order = np.argsort(known, kind='stable')[:count]
        self._archive, self._costs = everyone[order], known[order]
        weight = np.exp(-0.5 * (np.arange(count) / (_LOCALITY * count)) ** 2)
        chosen = self._archive[self._rng.choice(count, size=count, p=weight / weight.sum())]
        away = np.abs(self._archive - chosen[:, np.newaxis, :]).sum(axis=1) / (count - 1)
        moved: Array = chosen + _EVAPORATION * away * self._rng.standard_normal(chosen.shape)
        return moved
