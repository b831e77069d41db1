"""Optimizers that ask for the costs of many points at once and are told them.

They search the cube ``[-1, 1]^d``, whose centre is the middle of the box: several of them are
drawn to the origin of their coordinates, so the origin must be a place that is worth being drawn
to.
"""

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError

Array = NDArray[np.float64]


class Optimizer(ABC):
    """A population that moves by rules of its own.

    Parameters
    ----------
    dimension, population:
        Numbers of coordinates and of members.
    iterations:
        The budget is this many costs for every member.  Schedules (of an inertia, a temperature
        ...) run over the budget.
    rng:
        Source of randomness; the same one gives the same run, bit for bit.

    Attributes
    ----------
    title, reference:
        What it is, and where it comes from.
    follows_shifts:
        Whether a problem that is moved within the box moves every step along with it.  An
        optimizer without that is drawn to the centre of the box.
    best, best_cost:
        (d,) best point so far and its cost.
    used:
        How many costs it was told.

    Notes
    -----
    A move may ask for fewer points than there are members: what counts is the budget of costs.
    """

    title: ClassVar[str]
    reference: ClassVar[str]
    follows_shifts: ClassVar[bool] = True

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        self._rng, self._budget = rng, population * iterations
        self._points = latin_hypercube(population, dimension, rng)
        self._asked = False
        self.used = 0
        self.best, self.best_cost = self._points[0].copy(), np.inf

    @property
    def progress(self) -> float:
        """Part of the budget that is used, 0 to 1."""
        return min(self.used / self._budget, 1.0)

    def include(self, point: Array) -> None:
        """Put a known point (d,) in the place of the first one, before the first `ask`."""
        self._points[0] = np.clip(point, -1.0, 1.0)

    def begin(self, points: Array) -> None:
        """Take (P, d) points in place of the first ones, before the first `ask`."""
        if points.shape != self._points.shape or self.used:
            raise UserError(
                f'first points of shape {points.shape} where {self._points.shape} are wanted, or '
                'after the first costs; give them before the first `ask`'
            )
        self._points = np.clip(points, -1.0, 1.0)

    def ask(self) -> Array:
        """Return the (K, d) points whose costs are wanted; until they are told, the same."""
        self._asked = True
        return self._points.copy()

    def tell(self, costs: Array) -> None:
        """Take their (K,) costs, infinite or NaN where there is none, and move."""
        if not self._asked or costs.shape != self._points.shape[:1]:
            raise UserError(
                f'costs of shape {costs.shape} for {len(self._points)} points'
                f'{"" if self._asked else " that nobody asked for"}; '
                'call `ask`, then `tell` with one cost for each point'
            )
        known = np.where(np.isnan(costs), np.inf, costs)
        first = int(np.argmin(known))
        if known[first] < self.best_cost:
            self.best, self.best_cost = self._points[first].copy(), float(known[first])
        self._asked = False
        self.used += costs.size
        self._points = np.clip(self._move(known), -1.0, 1.0)

    @abstractmethod
    def _move(self, costs: Array) -> Array:
        """Take the costs (K,) of the points; return the next ones, which are kept in the cube."""


class Greedy(Optimizer):
    """Members that go only where it is better.

    Attributes
    ----------
    _members, _costs:
        (P, d) and (P,); the points that were asked for are trials of the members in that order.
    """

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._members = self._points.copy()
        self._costs = np.full(population, np.inf)

    def _move(self, costs: Array) -> Array:
        better = costs <= self._costs
        self._members = np.where(better[:, np.newaxis], self._points, self._members)
        self._costs = np.where(better, costs, self._costs)
        return self._trials()

    @abstractmethod
    def _trials(self) -> Array:
        """Return a trial (P, d) for every member."""


def latin_hypercube(population: int, dimension: int, rng: np.random.Generator) -> Array:
    """Return (P, d) points of ``[-1, 1]^d``, evenly spread along every coordinate."""
    cells = np.argsort(rng.random((population, dimension)), axis=0)
    return 2.0 * (cells + rng.random((population, dimension))) / population - 1.0


def others(count: int, wanted: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Return for each of `count` members `wanted` different others, (wanted, count) indices."""
    order = rng.random((count, count))
    np.fill_diagonal(order, np.inf)
    return np.argsort(order, axis=1)[:, :wanted].T


def levy(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Return steps whose lengths have the tail of a stable law with exponent 1.5.

    (Mantegna 1994, doi:10.1103/PhysRevE.49.4677.)
    """
    flat, width = _MANTEGNA
    return width * rng.standard_normal(shape) / np.abs(rng.standard_normal(shape)) ** (1.0 / flat)


_MANTEGNA = (1.5, 0.6965745025576968)
"""Exponent, and the width of the numerator that goes with it."""
