"""The swarms, and one function that runs any of them.  To add one: write its file, add it here."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.gwo import GreyWolves
from motor_sysid.estimation.batch.pso import ParticleSwarm
from motor_sysid.estimation.batch.swarm import Swarm

Array = NDArray[np.float64]

SWARMS: dict[str, type[Swarm]] = {'pso': ParticleSwarm, 'gwo': GreyWolves}
"""Every swarm by its key."""


@dataclass(frozen=True)
class Found:
    """What a swarm has found.

    Attributes
    ----------
    x, cost:
        (d,) best point and its cost.
    evaluations:
        How many costs were asked for.
    history:
        (iterations,) best cost so far after each iteration.
    """

    x: Array
    cost: float
    evaluations: int
    history: Array


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
) -> Found:
    """Minimize a function over a box with a swarm.

    Parameters
    ----------
    function:
        ``(P, d) -> (P,)`` costs of a population.
    lower, upper:
        (d,) box.
    method:
        Key of the swarm.
    population, iterations:
        Members, and how often all of them are evaluated.
    rng:
        Source of randomness.
    start:
        (d,) point to be one of the first members.

    Raises
    ------
    UserError
        If the method is unknown, the box is empty or the swarm too small.
    """
    if method not in SWARMS:
        raise UserError(f'unknown swarm `{method}`; known are {", ".join(SWARMS)}')
    if population < 4 or iterations < 1:
        raise UserError(
            f'a swarm of {population} with {iterations} iterations; give 4 and 1 at least'
        )
    if not (np.all(np.isfinite(lower)) and np.all(np.isfinite(upper)) and np.all(lower <= upper)):
        raise UserError('the box of a swarm must be finite, with lower <= upper')
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    swarm = SWARMS[method](lower.size, population, iterations, rng)
    if start is not None:
        swarm.include((start - middle) / np.where(half > 0, half, 1.0))
    history = np.empty(iterations)
    for k in range(iterations):
        swarm.tell(function(np.clip(middle + half * swarm.ask(), lower, upper)))
        history[k] = swarm.best_cost
    best = np.clip(middle + half * swarm.best, lower, upper)
    return Found(best, swarm.best_cost, population * iterations, history)
