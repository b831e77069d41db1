"""Particle swarm optimization: particles that remember.

    v <- w v + c1 r1 (own best - x) + c2 r2 (best of all - x),   x <- x + v

with new random numbers for every coordinate.  Velocities are limited to a part of the box, and a
coordinate that meets a wall stays there and loses its velocity.  (Kennedy and Eberhart 1995,
doi:10.1109/ICNN.1995.488968.)  The variants differ in w, c1 and c2.
"""

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer

Array = NDArray[np.float64]

_FASTEST = 0.4
"""Largest step of a coordinate; the cube is 2 wide."""


class ParticleSwarm(Optimizer):
    """What every variant does."""

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._velocity = np.zeros((population, dimension))
        self._own, self._own_cost = self._points.copy(), np.full(population, np.inf)

    def _move(self, costs: Array) -> Array:
        remember(self._own, self._own_cost, self._points, costs)
        inertia, own, social = self._coefficients(costs)
        r1, r2 = self._rng.random((2, *self._points.shape))
        pull = own * r1 * (self._own - self._points) + social * r2 * (self.best - self._points)
        return flown(self._points, inertia * self._velocity + pull, self._velocity)

    @abstractmethod
    def _coefficients(self, costs: Array) -> tuple[Array | float, float, float]:
        """Return inertia, a number or (P, 1), and the pulls of the own best and of all."""


class ConstrictionSwarm(ParticleSwarm):
    """The right form of the constriction: ``phi = c1 + c2 > 4``, and the social term is there."""

    title = 'particle swarm, constriction'
    reference = 'Clerc and Kennedy 2002, doi:10.1109/4235.985692'

    def _coefficients(self, costs: Array) -> tuple[Array | float, float, float]:
        return CHI, CHI * C, CHI * C


C = 2.05
CHI = 2.0 / abs(2.0 - 2 * C - np.sqrt((2 * C) ** 2 - 8 * C))
"""0.7298; under a sum of the pulls of 4 the root is not real, and nothing is constricted."""


class InertiaSwarm(ParticleSwarm):
    """Constant inertia 0.7 with pulls of 1.5."""

    title = 'particle swarm, inertia'
    reference = 'Shi and Eberhart 1998, doi:10.1109/ICEC.1998.699146'

    def _coefficients(self, costs: Array) -> tuple[Array | float, float, float]:
        return 0.7, 1.5, 1.5


class AdaptiveSwarm(ParticleSwarm):
    """Particles that are better than the mean are slowed down, from 1.2 to 0.2 for the best."""

    title = 'particle swarm, adaptive inertia'
    reference = 'Liu et al. 2005, doi:10.1016/j.chaos.2004.11.095'

    def _coefficients(self, costs: Array) -> tuple[Array | float, float, float]:
        known = costs[np.isfinite(costs)]
        if known.size == 0 or known.mean() <= known.min():
            return 0.7, 2.0, 2.0
        part = (costs - known.min()) / (known.mean() - known.min())
        return (0.2 + np.minimum(part, 1.0))[:, np.newaxis], 2.0, 2.0


class DynamicSwarm(ParticleSwarm):
    """Inertia from 0.9 to 0.4, own pull from 2.5 to 0.5, social pull from 0.5 to 2.5."""

    title = 'particle swarm, time-varying'
    reference = 'Ratnaweera et al. 2004, doi:10.1109/TEVC.2004.826071'

    def _coefficients(self, costs: Array) -> tuple[Array | float, float, float]:
        late = self.progress
        return 0.9 - 0.5 * late, 2.5 - 2.0 * late, 0.5 + 2.0 * late


def remember(own: Array, own_cost: Array, points: Array, costs: Array) -> NDArray[np.bool_]:
    """Put better points into (P, d) and (P,) memories; return (P,) where that was."""
    better = costs < own_cost
    own[better], own_cost[better] = points[better], costs[better]
    return better


def flown(points: Array, wish: Array, velocity: Array) -> Array:
    """Return (P, d) points after a step with the wished velocity; `velocity` is overwritten."""
    velocity[:] = np.clip(wish, -_FASTEST, _FASTEST)
    free = points + velocity
    walled = np.clip(free, -1.0, 1.0)
    velocity[free != walled] = 0.0
    return walled
