"""Particles that attract each other, too: ``v <- r v + 0.5 r a + 1.5 r (best - x)``.

The acceleration a is that of the gravitational search.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer
from motor_sysid.estimation.batch.optimizers.gsa import pulled
from motor_sysid.estimation.batch.optimizers.pso import flown

Array = NDArray[np.float64]

_GRAVITY, _SOCIAL = 0.5, 1.5


class GravitySwarm(Optimizer):
    """Particle swarm and gravitational search."""

    title = 'particles and gravity'
    reference = 'Mirjalili and Hashim 2010, doi:10.1109/ICCIA.2010.6141614'

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._velocity = np.zeros((population, dimension))

    def _move(self, costs: Array) -> Array:
        pull = pulled(self._points, costs, self.progress, self._rng)
        keep, r1, r2 = self._rng.random((3, *self._points.shape))
        wish = keep * self._velocity + _GRAVITY * r1 * pull
        wish += _SOCIAL * r2 * (self.best - self._points)
        return flown(self._points, wish, self._velocity)
