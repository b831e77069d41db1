"""Total least squares: every column of an equation may be noisy, and how much is known.

With D = (X y) and N the covariance of its noise, the smallest v'D'D v / v'N v over v = (c, -1). N
is read from what a free run leaves of the rows. (Golub and Van Loan 1980, doi:10.1137/0717073; Van
Huffel and Vandewalle, The Total Least Squares Problem, 1991, chapter 8.)
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from motor_sysid.estimation.batch.methods.instruments import instrument_rows
from motor_sysid.estimation.batch.methods.rows import least_squares, sandwich, solved
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]


def fit(problem: Problem) -> FitResult:
    """Solve the filtered balances with the noise of their columns known."""
    records = [stretch.record for stretch in problem.stretches]
    begun = solved(problem, lambda model, k, x, y: least_squares(x, y)).model

    def solve(model: Model, k: int, x: Array, y: Array) -> tuple[Array, Array]:
        clean_x, clean_y = instrument_rows(begun, k, records, problem.outputs)
        return total(x, y, np.column_stack([x - clean_x, y - clean_y]))

    for _ in range(2):
        here = Problem(begun, problem.chains, problem.outputs, substeps=problem.substeps)
        result = solved(here, solve, passes=1)
        begun = result.model
    return result


def total(x: Array, y: Array, noise: Array) -> tuple[Array, Array]:
    """Return the solution (d,) and its covariance; `noise` is (K, d + 1)."""
    both = np.column_stack([x, y])
    size = np.sqrt(np.maximum(np.mean(both**2, axis=0), 1e-300))
    data, spread = both / size, (noise - noise.mean(axis=0)) / size
    gram, errors = data.T @ data, spread.T @ spread
    values, vectors = eigh(errors, gram)
    v = vectors[:, -1]
    found = -v[:-1] / v[-1]
    share = 1 / values[-1]
    bread = np.linalg.pinv((gram - share * errors)[:-1, :-1])
    scores = data[:, :-1] * (data[:, -1] - data[:, :-1] @ found)[:, np.newaxis]
    scale = size[-1] / size[:-1]
    return found * scale, sandwich(bread, scores) * np.outer(scale, scale)
