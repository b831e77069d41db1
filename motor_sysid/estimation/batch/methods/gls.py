"""Weighted (generalized) least squares: rows are whitened by what the equation leaves.

The error of a filtered equation is strongly correlated; an autoregression fitted to it whitens the
rows, and both are repeated.  (Clarke 1967; Soderstrom and Stoica, System Identification, 1989,
section 7.5.)  More precise than least squares, with the same bias from noisy regressors.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from motor_sysid.estimation.batch.methods.rows import least_squares, solved
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

_ORDER, _ROUNDS = 4, 5


def fit(problem: Problem) -> FitResult:
    """Solve the filtered balances, whitened."""
    return solved(problem, _solve)


def _solve(model: Model, k: int, x: Array, y: Array) -> tuple[Array, Array]:
    found = least_squares(x, y)
    for _ in range(_ROUNDS):
        taps = _whitener(y - x @ found[0])
        white_x = lfilter(taps, [1.0], x, axis=0)[_ORDER:]
        white_y = lfilter(taps, [1.0], y)[_ORDER:]
        found = least_squares(np.asarray(white_x), np.asarray(white_y))
    return found


def _whitener(error: Array) -> Array:
    """Return the (order + 1,) taps that whiten an error, by Yule-Walker."""
    covariance = np.array([error[: error.size - k] @ error[k:] for k in range(_ORDER + 1)])
    covariance[0] = covariance[0] * (1 + 1e-9) + 1e-300
    return np.concatenate(([1.0], -solve_toeplitz(covariance[:-1], covariance[1:])))
