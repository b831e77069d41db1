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
from motor_sysid.estimation.batch import Linearization, Problem, Weighting
from motor_sysid.estimation.batch.chains import Stretch
from motor_sysid.estimation.batch.least_squares import newton_step, normal_equations
from motor_sysid.physics.parameters import Parameter

Array = NDArray[np.float64]

MOVED = 0.35
"""Share of the squared held-out error that other values take away, from which on it is missing
physics.  Of 137 models that were called complete before 136 had 0.17 or less, many of them with
random loads and controllers; the other one had 0.78, and lacked a winding that warms."""

CLEARLY = 0.1
"""Share by which another input takes away more than any parameter alone, where it is told."""

NUDGE = 1e-3
"""Relative step of the input in its derivative."""

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
    gain:
        What the input would have to be multiplied by there instead, if that takes away more: a
        supply that is weaker, say, than was reckoned with; else 1.
    by_gain:
        What that takes away.
    """

    share: float
    parameter: Parameter
    value: float
    alone: float
    gain: float = 1.0
    by_gain: float = 0.0

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
    k, step = _best_alone(gradient, curvature)
    alone = comparison_of([one.residual - one.slope[..., k] * step for one in near], problem)
    one = problem.free[k]
    there = z + step * (np.arange(z.size) == k)
    value = problem.model_at(np.clip(there, *problem.box()))[one.name]
    share, by_one = _less(best, now), _less(alone, now)
    gain, by_gain = _of_input(problem, near, weighting, now)
    if by_gain < by_one + CLEARLY:
        return best, OtherValues(share, one, value, by_one)
    return best, OtherValues(share, one, value, by_one, gain, by_gain)


def _best_alone(gradient: Array, curvature: Array) -> tuple[int, float]:
    """Return which coordinate lowers the cost most alone, and its step."""
    energy = np.maximum(np.diag(curvature), 1e-300)
    k = int(np.argmax(gradient**2 / energy))
    return k, float(gradient[k] / energy[k])


def _of_input(
    problem: Problem, near: Sequence[Linearization], weighting: Weighting, now: Comparison
) -> tuple[float, float]:
    """Return what the inputs should be multiplied by, and what that takes away alone."""
    slopes = slopes_by_input(problem)
    along = [replace(one, slope=slope) for one, slope in zip(near, slopes, strict=True)]
    gradient, curvature, _ = normal_equations(along, weighting)
    if not np.all(np.isfinite(curvature)):
        return 1.0, 0.0
    _, step = _best_alone(gradient, curvature)
    alone = comparison_of([one.residual - one.slope[..., 0] * step for one in along], problem)
    return 1.0 + step, _less(alone, now)


def slopes_by_input(problem: Problem) -> list[Array]:
    """Return (N, n_y, 1) derivatives of each scored stretch by the logarithm of all inputs."""
    z = problem.vector()[np.newaxis]
    louder = [tuple(_louder(s) for s in chain) for chain in problem.chains]
    scaled = Problem(problem.model, louder, problem.outputs, substeps=problem.substeps)
    pairs = zip(problem.simulate(z), scaled.simulate(z), strict=True)
    return [(more - now) / NUDGE for now, more in pairs]


def _louder(stretch: Stretch) -> Stretch:
    """Return a stretch with inputs that are a little larger."""
    drive = stretch.drive
    return replace(stretch, drive=replace(drive, inputs=(1.0 + NUDGE) * drive.inputs))


def _less(better: Comparison, now: Comparison) -> float:
    """Return the share of the squared error that is not there any more."""
    return max(0.0, 1.0 - (better.error_percent / max(now.error_percent, 1e-300)) ** 2)
