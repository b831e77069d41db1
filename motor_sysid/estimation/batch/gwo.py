"""Grey wolf optimization.

Every wolf moves to the mean of three points, one for each of the best three found so far:

    x_l = leader - A |C leader - x|,  A = a (2 r1 - 1),  C = 2 r2,  a from 2 to 0.

(Mirjalili, Mirjalili and Lewis 2014, doi:10.1016/j.advengsoft.2013.12.007.)
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.swarm import Swarm

Array = NDArray[np.float64]


class GreyWolves(Swarm):
    """Wolves that follow the best three; see `Swarm`."""

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._leaders = np.zeros((0, dimension))
        self._leader_costs = np.zeros(0)

    def _move(self, costs: Array) -> None:
        everyone = np.concatenate([self._leaders, self._members])
        order = np.argsort(np.concatenate([self._leader_costs, costs]), kind='stable')[:3]
        self._leader_costs = np.concatenate([self._leader_costs, costs])[order]
        self._leaders = everyone[order]
        a = 2.0 * max(1.0 - self._round / self._iterations, 0.0)
        r1, r2 = self._rng.random((2, len(order), *self._members.shape))
        leaders = self._leaders[:, np.newaxis, :]
        distance = np.abs(2.0 * r2 * leaders - self._members)
        points = leaders - a * (2.0 * r1 - 1.0) * distance
        self._members = np.clip(points.mean(axis=0), -1.0, 1.0)
