"""The moment of an effect that sets in: looked for over the whole record, not only downhill.

While nothing moves, it makes no difference when an inertia changed; so the error as a function of
the moment has steps and plateaus, on which a fit stays where it is.  A scan, every other parameter
as fitted, tells whether it is better elsewhere.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch import Problem, Weighting
from motor_sysid.estimation.batch.information import Information
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

_GRID = 63
_WORTH = 2.0
"""Decrease of the weighted sum of squares below which a moment stays where it is."""

_CHANCE = 3.84


def with_best_moments(problem: Problem, weighting: Weighting) -> Model:
    """Return the problem's model, fitted, with each moment where the error is least.

    Parameters
    ----------
    problem:
        The fitted model and the data.
    weighting:
        Noise model of the fit.
    """
    model = problem.model
    moments = [(key, effect(key).card.moment) for key in model.effects]
    names = [f'{key}.{moment}' for key, moment in moments if moment]
    free = [p.name for p in problem.free]
    for name in names:
        if name in free:
            model = _moved(problem, model, free.index(name), weighting)
    return model


def unseen_moments(model: Model) -> list[str]:
    """Return moments of which the derivatives of a fit tell nothing, for nothing moved there.

    A step of the fit takes them anywhere, and nothing else gets to its best.
    """
    names = [f'{key}.{effect(key).card.moment}' for key in model.effects]
    return [
        p.name
        for p in model.parameters.free
        if p.name in names and (p.sigma is None or p.sigma > p.upper - p.lower)
    ]


def with_honest_moments(
    problem: Problem, weighting: Weighting, bound: Information
) -> Model:
    """Return the problem's model, fitted, with the standard error of each moment from a scan.

    The error is no parabola in a moment: where nothing moves it is flat, and beside that a
    staircase.  The standard error is half of how far the error stays within what chance allows
    (95 %), to the side where that is farther, and no less than what one sample resolves, nor than
    what the slope of the error tells where there is one.  Noise that is correlated makes chance
    larger: as much as the standard error of the slope is larger than the `bound` for white noise.
    """
    model = problem.model
    free = [p.name for p in problem.free]
    moments = [f'{key}.{effect(key).card.moment}' for key in model.effects]
    found = {}
    near = problem.linearize(problem.vector(), parameters=False)
    for name in moments:
        if name not in free:
            continue
        z, at = problem.vector(), free.index(name)
        dt = problem.stretches[0].drive.dt / float(problem.slope(z)[at])
        away = _distances(z[at], dt, *(bound[at] for bound in problem.box()))
        cloud = np.repeat(z[np.newaxis, :], away.size, axis=0)
        cloud[:, at] += away
        p = model.parameters[name]
        linear = p.sigma if p.sigma is not None and p.sigma < p.upper - p.lower else 0.0
        chance = _CHANCE * max(linear / float(bound.bound[at]), 1.0) ** 2
        least = float(problem.costs(z[np.newaxis, :], weighting, near)[0])
        inside = problem.costs(cloud, weighting, near) < least + chance
        farthest = float(np.max(np.abs(away[inside]), initial=0.0))
        error = max(farthest / np.sqrt(_CHANCE), dt / np.sqrt(12.0))
        error *= float(problem.slope(z)[at])
        found[name] = max(linear, error)
    return model.with_estimates({}, found)


def _distances(moment: float, dt: float, lower: float, upper: float) -> Array:
    """Return distances to other moments: from one sample to the ends of the box, both ways."""
    before, after = (
        np.geomspace(dt, max(end, 2.0 * dt), _GRID // 2)
        for end in (moment - lower, upper - moment)
    )
    away = np.concatenate((-before, after))
    return away[(moment + away >= lower) & (moment + away <= upper)]


def _moved(problem: Problem, model: Model, at: int, weighting: Weighting) -> Model:
    """Return the model with the parameter number `at` at its best, others as they are."""
    z = problem.vector()
    lower, upper = (bound[at] for bound in problem.box())
    near = problem.linearize(z, parameters=False)
    best, least = z[at], float(problem.costs(z[np.newaxis, :], weighting, near)[0]) - _WORTH
    width = upper - lower
    for _ in range(3):
        grid = np.linspace(max(lower, best - width), min(upper, best + width), _GRID)
        cloud = np.repeat(z[np.newaxis, :], _GRID, axis=0)
        cloud[:, at] = grid
        costs = problem.costs(cloud, weighting, near)
        k = int(np.argmin(costs))
        if costs[k] < least:
            best, least = grid[k], float(costs[k])
        width = 2.0 * (grid[1] - grid[0])
    if best == z[at]:
        return model
    z[at] = best
    name = problem.free[at].name
    return model.with_values({name: float(problem.values(z[np.newaxis, :])[name][0])})
