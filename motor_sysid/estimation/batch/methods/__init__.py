"""Ways to fit a model to records, beside the optimizers.  To add one: write its file, add it."""

from collections.abc import Callable
from functools import partial

from motor_sysid.estimation.batch.least_squares import fit as fit_output_error
from motor_sysid.estimation.batch.methods import (
    characteristic_points,
    delay_profiled,
    frequency_response,
    gls,
    iv,
    ls,
    prediction_error,
    robust,
    steiglitz_mcbride,
    svf,
    tls,
    two_stage,
)
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult

DIRECT: dict[str, Callable[[Problem], FitResult]] = {
    'least_squares': fit_output_error,
    'prediction_error': prediction_error.fit,
    'two_stage': two_stage.fit,
    **{name: partial(robust.fit, loss=loss) for name, loss in robust.LOSSES.items()},
    'delay_profiled': delay_profiled.fit,
    'frequency_response': frequency_response.fit,
    'characteristic_points': characteristic_points.fit,
    'steiglitz_mcbride': steiglitz_mcbride.fit,
    'ls': ls.fit,
    'svf': svf.fit,
    'gls': gls.fit,
    'tls': tls.fit,
    'iv': iv.fit,
}
"""Every way by its key: from a problem to a result."""

STARTED: dict[str, tuple[str, Callable[[Problem], Problem]]] = {
    'cpm_gwo': ('gwo', characteristic_points.begun),
}
"""Hybrids by key: the optimizer, and what gives it a start that is near."""
