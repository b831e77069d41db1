"""NSGA-II: several costs at once, and all compromises between them.

Members are sorted into fronts (nobody in the first is beaten by anybody), and within a front by
how lonely they are.  Duels choose the parents, crossover and mutation make as many
children, and the best half of both goes on.  (Deb et al. 2002, doi:10.1109/4235.996017.)
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.optimizers.base import latin_hypercube
from motor_sysid.estimation.batch.optimizers.variation import crossed, mutated, tournament

Array = NDArray[np.float64]
Order = NDArray[np.intp]

_CROSSOVER = 0.9


@dataclass(frozen=True)
class Front:
    """Compromises of which none is better than another in every cost.

    Attributes
    ----------
    x, costs:
        (F, d) points and their (F, m) costs, by growing first cost.
    evaluations:
        How many points were asked for.
    """

    x: Array
    costs: Array
    evaluations: int


class SortedPopulation:
    """NSGA-II in the cube ``[-1, 1]^d``: `ask` for points, `tell` their (P, m) costs.

    Parameters
    ----------
    dimension, population:
        Numbers of coordinates and of members.
    rng:
        Source of randomness.
    """

    def __init__(self, dimension: int, population: int, rng: np.random.Generator) -> None:
        self._rng, self._points = rng, latin_hypercube(population, dimension, rng)
        self.members, self.costs = np.zeros((0, dimension)), np.zeros((0, 0))
        self.front = np.zeros(0, dtype=np.intp)

    def ask(self) -> Array:
        """Return the (P, d) points whose costs are wanted."""
        return self._points.copy()

    def tell(self, costs: Array) -> None:
        """Take their (P, m) costs; a row with an infinite one or a NaN is beaten by all others."""
        known = np.where(np.all(np.isfinite(costs), axis=1)[:, np.newaxis], costs, np.inf)
        everyone = np.vstack([self.members, self._points])
        values = np.vstack([self.costs.reshape(-1, known.shape[1]), known])
        front = fronts(values)
        order = np.lexsort((-loneliness(values, front), front))
        kept = order[: len(self._points)]
        self.members, self.costs, self.front = everyone[kept], values[kept], front[kept]
        parents = self.members[tournament(np.arange(len(kept)), self._rng)]
        children = crossed(parents, _CROSSOVER, self._rng)
        rate = 1.0 / self.members.shape[1]
        self._points = np.clip(mutated(children, rate, self._rng), -1.0, 1.0)


def pareto(
    function: Callable[[Array], Array],
    lower: Array,
    upper: Array,
    *,
    population: int = 60,
    iterations: int = 100,
    rng: np.random.Generator,
) -> Front:
    """Return the compromises between several costs over a box.

    Parameters
    ----------
    function:
        ``(P, d) -> (P, m)`` costs; infinite or NaN where there is none.
    lower, upper:
        (d,) box.
    population, iterations:
        Members, and how often children are made; their product is the number of evaluations.
    rng:
        Source of randomness.

    Raises
    ------
    UserError
        If the box is not finite or empty, or the population too small.
    """
    if not (np.all(np.isfinite(lower)) and np.all(np.isfinite(upper)) and np.all(lower <= upper)):
        raise UserError('the box of a search must be finite, with lower <= upper')
    if population < 4 or iterations < 1:
        raise UserError(
            f'a population of {population} with {iterations} iterations; give 4 and 1 at least'
        )
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    sorter = SortedPopulation(lower.size, population, rng)
    for _ in range(iterations):
        sorter.tell(function(np.clip(middle + half * sorter.ask(), lower, upper)))
    best = (sorter.front == 0) & np.all(np.isfinite(sorter.costs), axis=1)
    x = np.clip(middle + half * sorter.members[best], lower, upper)
    costs = sorter.costs[best]
    order = np.lexsort(costs.T[::-1])
    return Front(x[order], costs[order], population * iterations)


def fronts(costs: Array) -> Order:
    """Return (N,) the front of each of (N, m) costs, 0 the one that nobody beats."""
    no_worse = np.all(costs[:, np.newaxis] <= costs[np.newaxis, :], axis=2)
    beats = no_worse & ~no_worse.T
    found = np.full(len(costs), -1)
    level = 0
    while np.any(found < 0):
        left = found < 0
        free = left & ~np.any(beats[left], axis=0)
        found[free] = level
        level += 1
    return found


def loneliness(costs: Array, front: Order) -> Array:
    """Return (N,) the crowding distance of each within its front; infinite at its ends."""
    found = np.zeros(len(costs))
    for level in range(int(front.max()) + 1):
        mine = np.flatnonzero(front == level)
        for values in costs[mine].T:
            order = np.argsort(values, kind='stable')
            ends = mine[order[[0, -1]]]
            low, high = values[order[[0, -1]]]
            if np.isfinite(high) and high > low:
                found[mine[order[1:-1]]] += (values[order[2:]] - values[order[:-2]]) / (high - low)
            found[ends] = np.inf
    return found
