"""Differential evolution that learns its F and CR from what succeeded (SHADE, L-SHADE).

    x + F (one of the best p - x) + F (x1 - x2),   x2 also from an archive of what was left

Each member draws F from a Cauchy and CR from a normal distribution (width 0.1) around one of the
remembered means; successful values enter the memory, weighed by what they gained.  L-SHADE lets
the population shrink to 4 over the budget, so that the end is spent on few members.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer
from motor_sysid.estimation.batch.optimizers.de import between, each

Array = NDArray[np.float64]

_MEMORY, _WIDTH, _BEST, _FEWEST = 6, 0.1, 0.11, 4


class SuccessHistory(Optimizer):
    """Learns F and CR; the population keeps its size."""

    title = 'differential evolution, SHADE'
    reference = 'Tanabe and Fukunaga 2013, doi:10.1109/CEC.2013.6557555'

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._members, self._costs = self._points.copy(), np.full(population, np.inf)
        self._archive = np.zeros((0, dimension))
        self._means, self._slot = np.full((2, _MEMORY), 0.5), 0
        self._drawn = np.full((2, population), 0.5)
        self._largest = population

    def _move(self, costs: Array) -> Array:
        better = costs < self._costs
        if self.used > self._largest:
            self._learn(better, costs)
        taken = costs <= self._costs
        self._members = np.where(taken[:, np.newaxis], self._points, self._members)
        self._costs = np.where(taken, costs, self._costs)
        self._shrink()
        return self._trials()

    def _wanted(self) -> int:
        """Return how many members there shall be."""
        return self._largest

    def _learn(self, better: NDArray[np.bool_], costs: Array) -> None:
        """Put what succeeded into the memory, and what it replaced into the archive."""
        if not np.any(better):
            return
        gain = np.minimum(self._costs[better] - costs[better], 1e300)
        weight = gain / gain.max() if gain.max() > 0 else np.ones(gain.size)
        for row, values in enumerate(self._drawn[:, better]):
            size = float(weight @ values)
            self._means[row, self._slot] = float(weight @ values**2) / size if size > 0 else 0.0
        self._slot = (self._slot + 1) % _MEMORY
        self._archive = np.vstack([self._archive, self._members[better]])

    def _shrink(self) -> None:
        """Let the worst go; keep as many in the archive as there are members."""
        stay = np.sort(np.argsort(self._costs, kind='stable')[: self._wanted()])
        self._members, self._costs = self._members[stay], self._costs[stay]
        extra = len(self._archive) - len(stay)
        if extra > 0:
            kept = self._rng.permutation(len(self._archive))[extra:]
            self._archive = self._archive[kept]

    def _trials(self) -> Array:
        x, count = self._members, len(self._members)
        f, cr = self._drawn = self._draw(count)
        first = max(round(_BEST * count), 2)
        leaders = np.argsort(self._costs, kind='stable')[:first]
        best = x[leaders[self._rng.integers(first, size=count)]]
        one = (np.arange(count) + self._rng.integers(1, count, size=count)) % count
        pool = np.vstack([x, self._archive])
        two = self._rng.integers(len(pool) - 2, size=count)
        for taken in np.sort(np.array([np.arange(count), one]), axis=0):  # two others
            two += two >= taken
        step = f[:, np.newaxis]
        mutant = x + step * (best - x) + step * (x[one] - pool[two])
        return np.where(each(x.shape, cr, self._rng), between(mutant, x), x)

    def _draw(self, count: int) -> Array:
        """Return (2, count) values of F and CR."""
        slot = self._rng.integers(_MEMORY, size=count)
        middle_f, middle_cr = self._means[:, slot]
        cr = np.clip(self._rng.normal(middle_cr, _WIDTH), 0.0, 1.0)
        low = np.arctan(-middle_f / _WIDTH) / np.pi  # a Cauchy law without its part under zero
        u = low + (0.5 - low) * (1 - self._rng.random(count))
        f = middle_f + _WIDTH * np.tan(np.pi * np.minimum(u, 0.4999))
        return np.array([np.clip(f, 1e-3, 1.0), cr])


class ShrinkingHistory(SuccessHistory):
    """Learns F and CR; the population shrinks over the budget."""

    title = 'differential evolution, L-SHADE'
    reference = 'Tanabe and Fukunaga 2014, doi:10.1109/CEC.2014.6900380'

    def _wanted(self) -> int:
        return max(round(self._largest + (_FEWEST - self._largest) * self.progress), _FEWEST)
