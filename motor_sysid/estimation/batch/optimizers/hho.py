"""Harris hawks: search from perches, then besiege the rabbit that gets tired.

The rabbit (the best) has the energy ``E = 2 e (1 - t)``, e uniform between -1 and 1.  While |E| is
1 or more, a hawk perches by a random other or between the flock and the box; under 1 it besieges
softly or hard, and when the rabbit would escape it dives: first to a point Y, and if that is no
better to ``Z = Y + s * Levy``.  The costs of Z are asked for on their own, so that each counts.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import levy, Optimizer

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_FLIGHT = 0.01


class Hawks(Optimizer):
    """Hawks around a rabbit."""

    title = 'Harris hawks'
    reference = 'Heidari et al. 2019, doi:10.1016/j.future.2019.02.028'
    follows_shifts = False

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._hawks, self._costs = self._points.copy(), np.full(population, np.inf)
        self._asked_for = np.arange(population)
        self._dives = np.zeros(population, dtype=bool)
        self._again = False

    def _move(self, costs: Array) -> Array:
        who = self._asked_for
        taken = ~self._dives[who] | (costs <= self._costs[who])
        self._hawks[who[taken]], self._costs[who[taken]] = self._points[taken], costs[taken]
        failed = who[~taken]
        if failed.size and not self._again:
            self._again, self._asked_for = True, failed
            shape = (failed.size, self._hawks.shape[1])
            step = self._rng.random(shape) * _FLIGHT * levy(shape, self._rng)
            dive: Array = self._points[~taken] + step
            return dive
        self._again, self._asked_for = False, np.arange(len(self._hawks))
        points, self._dives = self._flight()
        return points

    def _flight(self) -> tuple[Array, Flags]:
        """Return where every hawk goes, and which of them dive."""
        x = self._hawks
        energy = 2.0 * (2 * self._rng.random((len(x), 1)) - 1) * (1 - self.progress)
        tired = np.abs(energy) < 1
        siege, dives = besieged(x, self.best, energy, self._rng)
        return np.where(tired, siege, perched(x, self.best, self._rng)), tired[:, 0] & dives


def perched(x: Array, best: Array, rng: np.random.Generator) -> Array:
    """Return (P, d) perches: by a random other, or between the flock and the box."""
    r1, r2, r3, r4, choice = rng.random((5, len(x), 1))
    other = x[rng.integers(len(x), size=len(x))]
    by_other = other - r1 * np.abs(other - 2 * r2 * x)
    by_flock = best - x.mean(axis=0) - r3 * (2 * r4 - 1)
    perches: Array = np.where(choice < 0.5, by_flock, by_other)
    return perches


def besieged(
    x: Array, best: Array, energy: Array, rng: np.random.Generator
) -> tuple[Array, Flags]:
    """Return (P, d) where hawks go that besiege, and (P,) which of them dive there."""
    jump = 2 * (1 - rng.random((len(x), 1)))
    dives = rng.random(len(x)) < 0.5
    soft = np.abs(energy) >= 0.5
    around = best - energy * np.abs(jump * best - x)
    dive = np.where(soft, around, best - energy * np.abs(jump * best - x.mean(axis=0)))
    siege = np.where(soft, around - x, best - energy * np.abs(best - x))
    return np.where(dives[:, np.newaxis], dive, siege), dives
