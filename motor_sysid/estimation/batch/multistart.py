"""Fit from several starts: the given one, and the best of a cloud around it."""

from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from motor_sysid.estimation.batch.least_squares import fit_and_slopes, minimize, Solution
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.estimation.batch.weighting import Weighting, white
from motor_sysid.threads import in_threads

Array = NDArray[np.float64]

CLOUD = 62
"""Points of the cloud: two blocks of simulations, less two."""

REACH = 1.6
"""Half width of the cloud in the logarithm of positive parameters: a factor of 5."""

SAME = 1e-3
"""Relative difference of two sums of squares below which two fits ended in the same valley."""


def fit_multistart(*problems: Problem) -> FitResult:
    """Fit from the models' own values, and again from the best points of Sobol clouds.

    A cloud spreads positive parameters over a factor of 5 to either side; others keep their
    value.  A fit from its best point is made only if that beats where the first one began; only
    one of the fits that lead to the same valley goes on.  The best result is returned.

    Parameters
    ----------
    problems:
        The same data, with models that differ in their values and in their speed sensor.
    """
    ends: list[tuple[Problem, Weighting, Solution]] = []
    for end in chain.from_iterable(in_threads(_valleys, problems)):
        if not any(_is_same(end, other) for other in ends):
            ends.append(end)
    return min(in_threads(_followed, ends), key=misfit)


@np.errstate(over='ignore', invalid='ignore')  # parameters on the way may be no motor
def _valleys(problem: Problem) -> list[tuple[Problem, Weighting, Solution]]:
    """Return where one or two fits end, with noise as large as the signals."""
    start = problem.vector()
    cloud = np.vstack([start, _cloud(problem, start)])
    weighting = white([s.judged - s.judged.mean(axis=0) for s in problem.stretches])
    near = problem.linearize(start, parameters=False)
    best = int(np.argmin(problem.costs(cloud, weighting, near)))
    begun = [start] if best == 0 else [start, cloud[best]]
    return [(problem, weighting, minimize(problem, weighting, start=one)) for one in begun]


def _is_same(
    one: tuple[Problem, Weighting, Solution], other: tuple[Problem, Weighting, Solution]
) -> bool:
    """Whether two fits ended in the same valley."""
    if one[0].model.speed_sensor is not other[0].model.speed_sensor:
        return False
    return abs(one[2].cost - other[2].cost) <= SAME * other[2].cost


def _followed(end: tuple[Problem, Weighting, Solution]) -> FitResult:
    """Fit on from where a valley ends, with noise as large as what is left."""
    problem, weighting, found = end
    return fit_and_slopes(problem, weighting, start=found.z, near=found.near)[0]


def misfit(result: FitResult) -> float:
    """Return the log of the product of the error variances; comparable on the same data."""
    total = float(np.sum(np.log([max(v, 1e-300) for v in result.noise.values()])))
    return total if np.isfinite(total) else np.inf


def _cloud(problem: Problem, start: Array) -> Array:
    lower, upper = problem.box()
    moving = np.isfinite(problem.reach())
    unit = qmc.Sobol(max(start.size, 1), scramble=False).random(CLOUD + 2)[2:]
    moved = start + REACH * (2 * unit - 1) * moving
    return np.clip(moved, lower, upper)
