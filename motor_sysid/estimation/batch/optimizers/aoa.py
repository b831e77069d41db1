"""Arithmetic optimization: divide and multiply to explore, subtract and add to exploit.

In coordinates from 0 to 1, with s = 0.499 and ``p = 1 - t^(1/5)``, each coordinate of the best
becomes ``best / p * s`` or ``best * p * s``, or with a probability that grows from 0.2 to 1
``best - p s`` or ``best + p s``; the better place stays.  (In coordinates centred on the box the
factor s of the paper, ``(upper - lower) mu + lower``, would vanish.)  Division and multiplication
know a corner of the box, and subtraction and addition know one step only: it is the crudest here.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Greedy

Array = NDArray[np.float64]

_SIZE, _SLOW = 0.499, 5.0


class Arithmetic(Greedy):
    """The four operations on the best."""

    title = 'arithmetic optimization'
    reference = 'Abualigah et al. 2021, doi:10.1016/j.cma.2020.113609'
    follows_shifts = False

    def _trials(self) -> Array:
        exploit = self._rng.random(self._members.shape) < exploiting(self.progress)
        step = operated(self.best, self._members.shape, self.progress, self._rng)
        return np.where(exploit, step[1], step[0])


def exploiting(late: float) -> float:
    """Return the probability of exploitation at a part of the budget."""
    return 0.2 + 0.8 * late


def operated(
    best: Array, shape: tuple[int, ...], late: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return (P, d) points by division or multiplication, and by subtraction or addition."""
    unit, p = 0.5 * (best + 1.0), 1.0 - late ** (1 / _SLOW)
    one, two = rng.random((2, *shape)) < 0.5
    explored = np.where(one, unit / (p + np.finfo(float).eps), unit * p) * _SIZE
    exploited = unit + np.where(two, -1.0, 1.0) * p * _SIZE
    return 2.0 * explored - 1.0, 2.0 * exploited - 1.0
