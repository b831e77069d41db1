"""Closed loop in two stages: what the reference explains of the input, then the output error.

The first stage takes the noise that the controller feeds back out of the input; the second fits
the motor from it. Consistent whatever the colour of the noise, for a motor that is linear; dry
friction meets a smoother input than it had. (Van den Hof and Schrama 1993,
doi:10.1016/0005-1098(93)90015-L.)
"""

from motor_sysid.estimation.batch.chains import make_chain
from motor_sysid.estimation.batch.least_squares import fit as fit_output_error
from motor_sysid.estimation.batch.methods.reference import noise_free_input
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult


def fit(problem: Problem) -> FitResult:
    """Fit the output error from what the reference explains of the input."""
    kind, outputs = problem.model.kind, problem.outputs
    records = [noise_free_input(stretch.record, kind) for stretch in problem.stretches]
    chains = [make_chain(record, kind, outputs) for record in records]
    return fit_output_error(
        Problem(problem.model, chains, outputs, substeps=problem.substeps)
    )
