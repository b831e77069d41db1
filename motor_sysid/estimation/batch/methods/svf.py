"""Least squares between signals behind a state-variable filter.

The filter passes what moves the motor and gives derivatives without differencing; its corner lies
between the time constants of the motor.  What noise passes still biases a little.  (Young 1981,
doi:10.1016/0005-1098(81)90082-0.)
"""

from motor_sysid.estimation.batch.methods.rows import least_squares, solved
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult


def fit(problem: Problem) -> FitResult:
    """Solve the filtered balances."""
    return solved(problem, lambda model, k, x, y: least_squares(x, y))
