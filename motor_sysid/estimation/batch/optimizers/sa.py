"""Simulated annealing: chains that also go uphill while it is warm.

Every member is a chain of its own.  It steps by its own width times a normal number in one
coordinate or in all of them; it goes to a worse place with probability ``exp(-rise / T)``.  The
temperature starts at the spread of the first costs and falls by eight decades over the budget.
The width grows by a half after a step that was taken, and shrinks by a sixth after one that was
not.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer

Array = NDArray[np.float64]

_DECADES, _LONGER, _SHORTER, _WIDEST = 8.0, 1.5, 5 / 6, 1.0


class Annealing(Optimizer):
    """A chain for every member."""

    title = 'simulated annealing'
    reference = 'Kirkpatrick et al. 1983, doi:10.1126/science.220.4598.671'

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._chains, self._costs = self._points.copy(), np.full(population, np.inf)
        self._width = np.full(population, 0.1)
        self._warmest = 0.0

    def _move(self, costs: Array) -> Array:
        if self._warmest == 0.0:
            known = costs[np.isfinite(costs)]
            self._warmest = float(known.std()) if known.size else 0.0
        heat = max(self._warmest * 10.0 ** (-_DECADES * self.progress), 1e-300)
        with np.errstate(invalid='ignore', over='ignore'):
            rise = np.where(np.isfinite(costs), costs - self._costs, np.inf)
        luck = -heat * np.log1p(-self._rng.random(costs.size))
        taken = (rise <= luck) | ~np.isfinite(self._costs)
        self._chains[taken], self._costs[taken] = self._points[taken], costs[taken]
        self._width *= np.where(taken, _LONGER, _SHORTER)
        self._width = np.minimum(self._width, _WIDEST)
        return self._stepped()

    def _stepped(self) -> Array:
        count, d = self._chains.shape
        chosen: NDArray[np.int64] = self._rng.integers(d, size=(count, 1))
        alone = chosen == np.arange(d)
        every = self._rng.random((count, 1)) < 0.5
        step = self._width[:, np.newaxis] * self._rng.standard_normal((count, d))
        moved: Array = self._chains + np.where(alone | every, step, 0.0)
        return moved
