"""Gravitational search: members attract each other, the better the heavier.

The mass of a member is linear in its cost, 0 for the worst, and the masses sum to 1.  The k best,
from all down to one, attract: acceleration ``sum_j r_j G M_j (x_j - x) / (|x_j - x| + eps)`` with
G = exp(-20 t), t the part of the budget; ``v <- r v + acceleration``.  (G0 = 100 in the paper is
for boxes of half width 100; that of the cube is 1.)
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer

Array = NDArray[np.float64]

_FADE = 20.0


class Masses(Optimizer):
    """Members that attract each other."""

    title = 'gravitational search'
    reference = 'Rashedi et al. 2009, doi:10.1016/j.ins.2009.03.004'

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._velocity = np.zeros((population, dimension))

    def _move(self, costs: Array) -> Array:
        pull = pulled(self._points, costs, self.progress, self._rng)
        self._velocity = self._rng.random(pull.shape) * self._velocity + pull
        free = self._points + self._velocity
        self._velocity[np.abs(free) > 1.0] = 0.0
        return free


def pulled(points: Array, costs: Array, late: float, rng: np.random.Generator) -> Array:
    """Return (P, d) accelerations; `late` is the part of the budget that is used, 0 to 1."""
    known = np.isfinite(costs)
    if not np.any(known):
        return np.zeros(points.shape)
    worst, best = costs[known].max(), costs[known].min()
    mass = np.where(known, worst - costs, 0.0) if worst > best else known.astype(float)
    mass /= mass.sum()
    strong = np.argsort(-mass, kind='stable')[: max(round(len(mass) * (1.0 - late)), 1)]
    way = points[strong] - points[:, np.newaxis, :]
    distance = np.sqrt(np.sum(way**2, axis=2)) + np.finfo(float).eps
    strength = np.exp(-_FADE * late) * mass[strong] / distance
    pull: Array = np.einsum('ij,ijk,ijk->ik', strength, rng.random(way.shape), way)
    return pull
