"""Direct prediction error: the output error behind a noise model that is fitted with it.

    e = H^-1 (y - G u),    1 / H an autoregression of what the model leaves

Consistent in closed loop, too, if the noise model is rich enough; the plain output error is only
where noise is white.  Whitening slow noise makes fast signals count, so what is fast in the motor
must be in the model: without the current the inductance is missed.  (Ljung 1999, sections 7.2
and 13.4.)
"""

from motor_sysid.estimation.batch.least_squares import fit as fit_output_error
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.estimation.batch.weighting import coloured

_ORDER, _ROUNDS = 40, 6


def fit(problem: Problem) -> FitResult:
    """Fit model and noise in turn."""
    result = fit_output_error(problem)
    for _ in range(_ROUNDS):
        noise = coloured(result.residuals, _ORDER)
        result = fit_output_error(problem, noise, start=result.vector, reweight=0)
    return result
