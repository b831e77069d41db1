"""Teaching-learning: a teacher lifts the mean, then learners compare in pairs.

By turns every learner tries ``x + r (best - t mean)`` with t 1 or 2, and ``x + r (x - y)`` away
from a worse or ``x + r (y - x)`` towards a better other learner y; the better place stays. The
factor t = 2 on the mean makes the origin of the coordinates special.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Greedy, others

Array = NDArray[np.float64]


class Learners(Greedy):
    """Teacher and learner phases by turns."""

    title = 'teaching-learning'
    reference = 'Rao et al. 2011, doi:10.1016/j.cad.2010.12.015'
    follows_shifts = False

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._taught = False

    def _trials(self) -> Array:
        x, self._taught = self._members, not self._taught
        r = self._rng.random(x.shape)
        if self._taught:
            factor = self._rng.integers(1, 3, size=(len(x), 1))
            taught: Array = x + r * (self.best - factor * x.mean(axis=0))
            return taught
        (other,) = others(len(x), 1, self._rng)
        way = np.where(self._costs < self._costs[other], 1.0, -1.0)[:, np.newaxis]
        learned: Array = x + way * r * (x - x[other])
        return learned
