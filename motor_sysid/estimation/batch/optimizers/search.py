"""Minimize a function over a box with any of the optimizers."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.optimizers.base import Optimizer
from motor_sysid.estimation.batch.optimizers.catalogue import OPTIMIZERS

Array = NDArray[np.float64]

ON_BOUND = 1e-3
"""Distance from a wall, in widths of the box, at which a coordinate counts as on it."""

_GAIN = 1e-9


@dataclass(frozen=True)
class Stop:
    """When to end before the budget does; by default never.

    Attributes
    ----------
    cost:
        A cost that is good enough.
    spread:
        Width of the points that are asked for, in widths of the box, that counts as settled.
    stall:
        Costs without a gain of more than a billionth after which nothing more is expected; 0: any.
    """

    cost: float = -np.inf
    spread: float = 0.0
    stall: int = 0


@dataclass(frozen=True)
class Found:
    """What a search has found.

    Attributes
    ----------
    x, cost:
        (d,) best point and its cost.
    evaluations:
        How many costs were asked for.
    history:
        (K,) best cost so far after each move.
    reason:
        Why it ended, in words.
    on_bound:
        Coordinates in which the best point lies on a wall of the box.
    """

    x: Array
    cost: float
    evaluations: int
    history: Array
    reason: str
    on_bound: tuple[int, ...]


def search(
    function: Callable[[Array], Array],
    lower: Array,
    upper: Array,
    *,
    method: str = 'pso',
    population: int = 30,
    iterations: int = 50,
    rng: np.random.Generator,
    start: Array | None = None,
    stop: Stop | None = None,
) -> Found:
    """Minimize a function over a box.

    Parameters
    ----------
    function:
        ``(P, d) -> (P,)`` costs of points; infinite or NaN where there is none.
    lower, upper:
        (d,) box.
    method:
        Key of `OPTIMIZERS`.
    population, iterations:
        Members, and costs for each: their product is the budget, which is never exceeded.
    rng:
        Source of randomness.
    start:
        (d,) point to be one of the first members.
    stop:
        When to end earlier.

    Raises
    ------
    UserError
        If the method is unknown, the box is empty or the population too small.
    """
    if method not in OPTIMIZERS:
        raise UserError(f'unknown optimizer `{method}`; known are {", ".join(OPTIMIZERS)}')
    if population < 4 or iterations < 1:
        raise UserError(
            f'a population of {population} with {iterations} iterations; give 4 and 1 at least'
        )
    optimizer = OPTIMIZERS[method](lower.size, population, iterations, rng)
    budget = population * iterations
    return run(function, lower, upper, optimizer, budget, start=start, stop=stop)


def run(
    function: Callable[[Array], Array],
    lower: Array,
    upper: Array,
    optimizer: Optimizer,
    budget: int,
    *,
    start: Array | None = None,
    stop: Stop | None = None,
) -> Found:
    """Minimize with a fresh optimizer, of the catalogue or your own; see `search`.

    Raises
    ------
    UserError
        If the box is not finite or empty.
    """
    if not (np.all(np.isfinite(lower)) and np.all(np.isfinite(upper)) and np.all(lower <= upper)):
        raise UserError('the box of a search must be finite, with lower <= upper')
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    if start is not None:
        optimizer.include((start - middle) / np.where(half > 0, half, 1.0))
    history: list[float] = []
    watch = _Watch(stop or Stop(), history)
    while True:
        points = optimizer.ask()
        reason = watch.reason(optimizer, points, budget)
        if reason:
            break
        optimizer.tell(function(np.clip(middle + half * points, lower, upper)))
        history.append(optimizer.best_cost)
        watch.used.append(optimizer.used)
    walled = np.flatnonzero((np.abs(optimizer.best) > 1.0 - 2 * ON_BOUND) & (half > 0))
    best = np.clip(middle + half * optimizer.best, lower, upper)
    return Found(
        best, optimizer.best_cost, optimizer.used, np.array(history), reason,
        tuple(walled.tolist()),
    )  # fmt: skip


class _Watch:
    """Says why a search ends; `history` and `used` grow with it."""

    def __init__(self, stop: Stop, history: list[float]) -> None:
        self._stop, self._history = stop, history
        self.used: list[int] = []

    def reason(self, optimizer: Optimizer, points: Array, budget: int) -> str:
        """Return why to stop, in words, or nothing."""
        if optimizer.used + len(points) > budget:
            return f'the budget of {budget} costs is used'
        if optimizer.best_cost <= self._stop.cost:
            return f'a cost of {optimizer.best_cost:.4g} is good enough'
        width = 0.5 * float(np.max(np.ptp(points, axis=0))) if len(points) > 1 else np.inf
        if optimizer.used and width < self._stop.spread:
            return f'settled: the points lie within {width:.2g} of the width of the box'
        if self._stop.stall and self._stalled(optimizer):
            return f'no gain in the last {self._stop.stall} costs'
        return ''

    def _stalled(self, optimizer: Optimizer) -> bool:
        back = int(np.searchsorted(self.used, optimizer.used - self._stop.stall, side='right'))
        if back == 0:
            return False
        before, now = self._history[back - 1], optimizer.best_cost
        return not before - now > _GAIN * abs(now)
