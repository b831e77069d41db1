"""Rao-1: along the line from the worst to the best, ``x + r (best - worst)``."""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Greedy
from motor_sysid.estimation.batch.optimizers.jaya import ends

Array = NDArray[np.float64]


class RaoOne(Greedy):
    """Steps along the line from the worst to the best."""

    title = 'Rao-1'
    reference = 'Rao 2020, doi:10.5267/j.ijiec.2019.6.002'

    def _trials(self) -> Array:
        best, worst = ends(self._members, self._costs)
        trials: Array = self._members + self._rng.random(self._members.shape) * (best - worst)
        return trials
