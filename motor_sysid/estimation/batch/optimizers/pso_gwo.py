"""Particles or wolves, whichever has got further lately.

One pack with the memories of both.  Before every move one of the two rules is drawn, with a
probability in proportion to what it earned: one for a better best, and the share of members that
beat their own best, faded by a fifth at each use.  So the pack explores with the rule that pays
now, and the other one is tried from time to time.  Particles keep their velocity through moves of
the wolves.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer
from motor_sysid.estimation.batch.optimizers.gwo import encircled, Leaders
from motor_sysid.estimation.batch.optimizers.pso import C, CHI, flown, remember

Array = NDArray[np.float64]

_FADE, _LEAST = 0.8, 0.05


class Switching(Optimizer):
    """A bandit with two arms: particle swarm with constriction, and grey wolves."""

    title = 'particles and wolves, switching'
    reference = 'own rule; Auer et al. 2002, doi:10.1023/A:1013689704352, for bandits'
    follows_shifts = False

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._velocity = np.zeros((population, dimension))
        self._own, self._own_cost = self._points.copy(), np.full(population, np.inf)
        self._leaders = Leaders(dimension)
        self._earned, self._arm = np.ones(2), 0
        self._reached = np.inf

    def _move(self, costs: Array) -> Array:
        better = remember(self._own, self._own_cost, self._points, costs)
        self._leaders.update(self._points, costs)
        gain = float(self.best_cost < self._reached) + float(better.mean())
        self._reached = self.best_cost
        self._earned[self._arm] = _FADE * self._earned[self._arm] + (1 - _FADE) * gain
        chance = self._earned + _LEAST
        self._arm = int(self._rng.random() > chance[0] / chance.sum())
        return self._wolves() if self._arm else self._particles()

    def _particles(self) -> Array:
        r1, r2 = self._rng.random((2, *self._points.shape))
        pull = r1 * (self._own - self._points) + r2 * (self.best - self._points)
        return flown(self._points, CHI * (self._velocity + C * pull), self._velocity)

    def _wolves(self) -> Array:
        reach = 2.0 * (1 - self.progress)
        return encircled(self._points, self._leaders.points, reach, self._rng)
