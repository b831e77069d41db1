"""Particle swarm optimization with constriction.

    v <- chi (v + c r1 (own best - x) + c r2 (best of all - x)),  chi = 0.7298, c = 2.05

with new random numbers for every coordinate.  Velocities are limited to a part of the box, and a
coordinate that meets a wall stays there and loses its velocity.
(Clerc and Kennedy 2002, doi:10.1109/4235.985692; the social term and c1 + c2 > 4 are part of it.)
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.swarm import Swarm

Array = NDArray[np.float64]

_CHI, _C = 0.7298, 2.05
_FASTEST = 0.2


class ParticleSwarm(Swarm):
    """Particles that remember; see `Swarm`."""

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._velocity = np.zeros((population, dimension))
        self._own, self._own_cost = self._members.copy(), np.full(population, np.inf)

    def _move(self, costs: Array) -> None:
        better = costs < self._own_cost
        self._own[better], self._own_cost[better] = self._members[better], costs[better]
        r1, r2 = self._rng.random((2, *self._members.shape))
        pull = r1 * (self._own - self._members) + r2 * (self.best - self._members)
        velocity = _CHI * (self._velocity + _C * pull)
        self._velocity = np.clip(velocity, -2 * _FASTEST, 2 * _FASTEST)
        free = self._members + self._velocity
        self._members = np.clip(free, -1.0, 1.0)
        self._velocity[free != self._members] = 0.0
