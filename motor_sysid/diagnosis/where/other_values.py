"""Held-out data that ask for other values of the model's own parameters.

The parameters of a complete model are the same everywhere.  A winding that is hot in one record,
or iron that saturates in another, is a base parameter with another value there: no error is left
in the training data, and the held-out ones are described as well by a model of their own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.where.compare import Comparison, comparison_of
from motor_sysid.estimation.batch import Problem, Weighting
from motor_sysid.estimation.batch.least_squares import newton_step, normal_equations
from motor_sysid.physics.parameters import Parameter

Array = NDArray[np.float64]

MOVED = 0.35
"""Share of the squared held-out error that other values take away, from which on it is missing
physics.  Of 137 models that were called complete before 136 had 0.17 or less, many of them with
random loads and controllers; the other one had 0.78, and lacked a winding that warms."""

OPEN = 3.0
"""Standard errors of a parameter by which its value there may differ: the training data leave it
so far open, and that is no missing physics."""


@dataclass(frozen=True)
class OtherValues:
    """How much less is left of the held-out data with other values of the model's parameters.

    Attributes
    ----------
    share:
        Of the squared error, all parameters at their best there; none if that is not better.
    parameter:
        The one that takes away most alone, as fitted to the training data.
    value:
        Its value there.
    alone:
        What it takes away alone.
    """

    share: float
    parameter: Parameter
    value: float
    alone: float

    @property
    def told(self) -> float:
        """Share that other values take away than those that the training data leave open."""
        sigma = self.parameter.sigma
        if sigma is None or abs(self.value - self.parameter.value) > OPEN * sigma:
            return self.share
        return max(0.0, self.share - self.alone) / max(1.0 - self.alone, 1e-12)

    @property
    def times(self) -> float:
        """How many times larger the error is than with all parameters at their best."""
        return float(1.0 / np.sqrt(max(1.0 - self.share, 1e-12)))


def held_at_best(
    problem: Problem, residuals: Sequence[Array], weighting: Weighting
) -> tuple[Comparison, OtherValues | None]:
    """Return the comparison on held-out data with the model's own parameters at their best there.

    One step of Gauss and Newton is taken, as the parameters are nearly right; its derivatives need
    no fine steps of the integration.

    Parameters
    ----------
    problem:
        The fitted model and the held-out data.
    residuals:
        What it leaves of them, (N, n_y) for each scored stretch.
    weighting:
        The noise model of the fit.

    Returns
    -------
    The comparison, and what other values take away; none if the model has no derivatives there.
    """
    now, z = comparison_of(residuals, problem), problem.vector()
    pairs = zip(problem.linearize(z), residuals, strict=True)
    near = [replace(one, residual=residual) for one, residual in pairs]
    gradient, curvature, _ = normal_equations(near, weighting)
    move = newton_step(gradient, curvature)
    if not np.all(np.isfinite(move)) or not move.size:
        return now, None
    best = comparison_of([one.residual - one.slope @ move for one in near], problem)
    energy = np.maximum(np.diag(curvature), 1e-300)
    k = int(np.argmax(gradient**2 / energy))
    step = np.where(np.arange(z.size) == k, gradient / energy, 0.0)
    alone = comparison_of([one.residual - one.slope @ step for one in near], problem)
    one = problem.free[k]
    value = problem.model_at(np.clip(z + step, *problem.box()))[one.name]
    return best, OtherValues(_less(best, now), one, value, _less(alone, now))


def _less(better: Comparison, now: Comparison) -> float:
    """Return the share of the squared error that is not there any more."""
    return max(0.0, 1.0 - (better.error_percent / max(now.error_percent, 1e-300)) ** 2)
