"""Particles, of which those that got stuck ride a sine cosine wave.

A particle that has not beaten its own best for three moves goes to a wave around the best (as in
`sca`, from its own best); all others move as particles with inertia 0.7 and pulls of 1.5.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer
from motor_sysid.estimation.batch.optimizers.pso import flown, remember
from motor_sysid.estimation.batch.optimizers.sca import waved

Array = NDArray[np.float64]

_PATIENCE = 3


class WavingSwarm(Optimizer):
    """Particle swarm and sine cosine."""

    title = 'particles and sine cosine'
    reference = 'after Nenavath et al. 2018, doi:10.1016/j.swevo.2018.02.011'
    follows_shifts = False

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._velocity = np.zeros((population, dimension))
        self._own, self._own_cost = self._points.copy(), np.full(population, np.inf)
        self._stuck = np.zeros(population)

    def _move(self, costs: Array) -> Array:
        better = remember(self._own, self._own_cost, self._points, costs)
        self._stuck = np.where(better, 0, self._stuck + 1)
        waits = (self._stuck >= _PATIENCE)[:, np.newaxis]
        self._stuck[waits[:, 0]] = 0
        r1, r2 = self._rng.random((2, *self._points.shape))
        pull = r1 * (self._own - self._points) + r2 * (self.best - self._points)
        wish = 0.7 * self._velocity + 1.5 * pull
        wave = waved(self._own, self.best, 2.0 * (1 - self.progress), self._rng)
        wish = np.where(waits, np.clip(wave, -1, 1) - self._points, wish)
        return flown(self._points, wish, self._velocity)
