"""Genetic algorithm with real genes.

Duels choose the parents, 0.8 of the pairs cross, a tenth of the genes mutates, and the best member
stays.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Optimizer
from motor_sysid.estimation.batch.optimizers.variation import crossed, mutated, tournament

Array = NDArray[np.float64]

_CROSSOVER, _MUTATION = 0.8, 0.1


class Genes(Optimizer):
    """A generation of children at every step."""

    title = 'genetic algorithm'
    reference = 'Deb and Agrawal 1995 (simulated binary crossover); Goldberg 1989'

    def _move(self, costs: Array) -> Array:
        order = np.argsort(np.argsort(costs, kind='stable'), kind='stable')
        parents = self._points[tournament(order, self._rng)]
        children = mutated(crossed(parents, _CROSSOVER, self._rng), _MUTATION, self._rng)
        children[0] = self.best
        return children
