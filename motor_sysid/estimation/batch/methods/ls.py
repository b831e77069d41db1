"""Least squares between raw samples: derivatives are differences.

Kept as the baseline that it is: noise of a difference quotient grows with the sampling rate, and
noise in a regressor draws its coefficient to zero.  (Soderstrom and Stoica, System Identification,
1989, sections 4.2 and 7.2.)
"""

from motor_sysid.estimation.batch.methods.rows import least_squares, solved
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult

_FAST = 20.0


def fit(problem: Problem) -> FitResult:
    """Solve the balances between samples: the filter is so fast that it is none."""
    width = _FAST / problem.stretches[0].record.dt
    return solved(problem, lambda model, k, x, y: least_squares(x, y), bandwidth=width)
