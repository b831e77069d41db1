"""Fit from several starts: the given one, and the best of a cloud around it."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from motor_sysid.estimation.batch.least_squares import fit_and_slopes, minimize
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.estimation.batch.weighting import white

Array = NDArray[np.float64]

CLOUD = 62
"""Points of the cloud: two blocks of simulations, less two."""

REACH = 1.6
"""Half width of the cloud in the logarithm of positive parameters: a factor of 5."""

SAME = 1e-3
"""Relative difference of two sums of squares below which two fits ended in the same valley."""


@np.errstate(over='ignore', invalid='ignore')  # parameters on the way may be no motor
def fit_multistart(problem: Problem) -> FitResult:
    """Fit from the model's own values, and again from the best point of a Sobol cloud.

    The cloud spreads positive parameters over a factor of 5 to either side; others keep their
    value.  The second fit is made only if that point beats where the first one began, and goes on
    only where it leads to another valley.  The better result is returned.
    """
    start = problem.vector()
    cloud = np.vstack([start, _cloud(problem, start)])
    weighting = white([s.judged - s.judged.mean(axis=0) for s in problem.stretches])
    near = problem.linearize(start, parameters=False)
    best = int(np.argmin(problem.costs(cloud, weighting, near)))
    first = minimize(problem, weighting, start=start)
    ends = [first]
    if best > 0:
        second = minimize(problem, weighting, start=cloud[best])
        if not abs(second.cost - first.cost) <= SAME * first.cost:
            ends.append(second)
    fits = [
        fit_and_slopes(problem, weighting, start=end.z, near=end.near)[0] for end in ends
    ]
    return min(fits, key=misfit)


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
