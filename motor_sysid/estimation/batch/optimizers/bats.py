"""Bat algorithm, with the sign that attracts.

    v <- w v + f (best - x),   f uniform between 0 and 1,   x <- x + v

and, the more often the fewer pulses a bat sends, a step around the best: ``best + 0.3 A e`` with
the mean loudness A and e uniform in the cube.  A bat takes a better place with the
probability of its loudness; then it gets quieter (A <- 0.9 A) and calls more often
(``r = 1 - exp(-0.1 n)`` after n such places).

As first printed, and often copied, the velocity takes ``f (x - best)``, which doubles the
distance to the best at every step.  With the right sign the motion is undamped for f under 4,
hence the inertia w = 0.7.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer

Array = NDArray[np.float64]

_INERTIA, _HIGHEST, _FADE, _CALM, _LOCAL = 0.7, 1.0, 0.9, 0.1, 0.3


class Bats(Optimizer):
    """Bats that fly to the best one."""

    title = 'bats'
    reference = 'Yang 2010, doi:10.1007/978-3-642-12538-6_6; sign corrected'

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._members, self._costs = self._points.copy(), np.full(population, np.inf)
        self._velocity = np.zeros((population, dimension))
        self._loudness, self._successes = np.ones(population), np.zeros(population)

    def _move(self, costs: Array) -> Array:
        heard = self._rng.random(costs.size) < self._loudness
        taken = (costs <= self._costs) & heard
        self._members[taken], self._costs[taken] = self._points[taken], costs[taken]
        self._loudness[taken] *= _FADE
        self._successes += taken
        rate = 1.0 - np.exp(-_CALM * self._successes)
        pitch = _HIGHEST * self._rng.random((costs.size, 1))
        self._velocity = _INERTIA * self._velocity + pitch * (self.best - self._members)
        near = self.best + _LOCAL * self._loudness.mean() * self._rng.uniform(
            -1, 1, self._members.shape
        )
        close = self._rng.random(costs.size) > rate
        return np.where(close[:, np.newaxis], near, self._members + self._velocity)
