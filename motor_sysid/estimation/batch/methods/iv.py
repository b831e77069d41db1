"""Instrumental variables: the rows of a simulated model are the instruments.

    Z'(y - X c) = 0,    Z: the same filtered signals, from a free run of the last estimate

A free run has no noise of the sensors, so that errors in the regressors do not bias.  In a closed
loop it is driven by what the reference explains of the input.  (Young 1981,
doi:10.1016/0005-1098(81)90082-0; Soderstrom and Stoica, System Identification, 1989, chapter 8;
closed loop: Gilson and Van den Hof 2005, doi:10.1016/j.automatica.2004.09.016.)
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.methods.instruments import instrument_rows
from motor_sysid.estimation.batch.methods.rows import instrumental, least_squares, solved
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]


def fit(problem: Problem) -> FitResult:
    """Solve the filtered balances by least squares, then three times by instruments."""
    records = [stretch.record for stretch in problem.stretches]
    begun = solved(problem, lambda model, k, x, y: least_squares(x, y)).model

    def solve(model: Model, k: int, x: Array, y: Array) -> tuple[Array, Array]:
        return instrumental(instrument_rows(begun, k, records, problem.outputs)[0], x, y)

    for _ in range(2):
        here = Problem(begun, problem.chains, problem.outputs, substeps=problem.substeps)
        result = solved(here, solve, passes=1)
        begun = result.model
    return result
