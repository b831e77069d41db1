"""Arithmetic to explore, hawks to exploit.

Division and multiplication of `aoa` find regions; in place of its one step of subtraction and
addition the hawks of `hho` besiege the best.  The better place stays.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.aoa import exploiting, operated
from motor_sysid.estimation.batch.optimizers.base import Greedy
from motor_sysid.estimation.batch.optimizers.hho import besieged

Array = NDArray[np.float64]


class ArithmeticHawks(Greedy):
    """Arithmetic optimization and Harris hawks."""

    title = 'arithmetic and hawks'
    reference = 'own rule from the moves of both (doi:10.1016/j.cma.2020.113609, hho)'
    follows_shifts = False

    def _trials(self) -> Array:
        x, late = self._members, self.progress
        explored, _ = operated(self.best, x.shape, late, self._rng)
        energy = (2 * self._rng.random((len(x), 1)) - 1) * 2 * (1 - late)
        siege, _ = besieged(x, self.best, np.clip(energy, -1, 1), self._rng)
        hunts = self._rng.random((len(x), 1)) < exploiting(late)
        return np.where(hunts, siege, explored)
