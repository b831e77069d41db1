"""Flower pollination: far by insects, near by the wind.

With probability 0.8 a flower tries ``x + 0.3 L (best - x)`` with steps L of a Levy flight, else
``x + r (one - other)`` with two random flowers; the better place stays.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Greedy, levy

Array = NDArray[np.float64]

_STEP, _FAR = 0.3, 0.8


class Flowers(Greedy):
    """Pollen over long and short ways."""

    title = 'flower pollination'
    reference = 'Yang 2012, doi:10.1007/978-3-642-32894-7_27'

    def _trials(self) -> Array:
        x, count = self._members, len(self._members)
        far = x + _STEP * levy(x.shape, self._rng) * (self.best - x)
        one, other = (x[self._rng.permutation(count)] for _ in range(2))
        near = x + self._rng.random((count, 1)) * (one - other)
        return np.where(self._rng.random((count, 1)) < _FAR, far, near)
