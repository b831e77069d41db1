"""Jaya: towards the best, away from the worst, nothing to tune.

    x + r1 (best - x) - r2 (worst - x)

(The paper writes |x|.  That is x where the box is positive, as its coordinates count from the
lower wall here; on both sides of zero it would make the sign of a coordinate matter.)
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Greedy

Array = NDArray[np.float64]


class Jaya(Greedy):
    """Towards the best and away from the worst."""

    title = 'Jaya'
    reference = 'Rao 2016, doi:10.5267/j.ijiec.2015.8.004'

    def _trials(self) -> Array:
        best, worst = ends(self._members, self._costs)
        x = self._members
        r1, r2 = self._rng.random((2, *x.shape))
        trials: Array = x + r1 * (best - x) - r2 * (worst - x)
        return trials


def ends(members: Array, costs: Array) -> tuple[Array, Array]:
    """Return the best and the worst (d,) of (P, d) members."""
    return members[int(np.argmin(costs))], members[int(np.argmax(costs))]
