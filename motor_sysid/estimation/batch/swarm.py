"""Swarms: optimizers that ask for the cost of a whole population at once.

They search the cube ``[-1, 1]^d``, whose centre is the middle of the box: grey wolves are drawn to
the origin of their coordinates, so the origin must be a place that is worth being drawn to.
"""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Swarm(ABC):
    """A population that moves by rules of its own.

    Parameters
    ----------
    dimension, population:
        Numbers of coordinates and of members.
    iterations:
        How often `tell` will be called.
    rng:
        Source of randomness; the same one gives the same run, bit for bit.

    Attributes
    ----------
    best, best_cost:
        (d,) best member so far and its cost.
    """

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        self._rng, self._iterations = rng, iterations
        self._members = latin_hypercube(population, dimension, rng)
        self._round = 0
        self.best, self.best_cost = self._members[0].copy(), np.inf

    def include(self, member: Array) -> None:
        """Put a known point (d,) in the place of the first member, before the first `ask`."""
        self._members[0] = np.clip(member, -1.0, 1.0)

    def ask(self) -> Array:
        """Return the (P, d) members whose costs are wanted."""
        return self._members.copy()

    def tell(self, costs: Array) -> None:
        """Take their (P,) costs, infinite or NaN where there is none, and move."""
        known = np.where(np.isnan(costs), np.inf, costs)
        first = int(np.argmin(known))
        if known[first] < self.best_cost:
            self.best, self.best_cost = self._members[first].copy(), float(known[first])
        self._round += 1
        self._move(known)

    @abstractmethod
    def _move(self, costs: Array) -> None:
        """Set the next members; they must stay in the cube."""


def latin_hypercube(population: int, dimension: int, rng: np.random.Generator) -> Array:
    """Return (P, d) points of ``[-1, 1]^d``, evenly spread along every coordinate."""
    cells = np.argsort(rng.random((population, dimension)), axis=0)
    return 2.0 * (cells + rng.random((population, dimension))) / population - 1.0
