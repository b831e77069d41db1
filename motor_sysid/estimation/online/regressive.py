"""Regressions on state-variable-filtered signals, with any rule of learning.

Each balance of the motor kind is one regression; effects add their laws as regressors.  A raw
difference equation would be useless under sensor noise: the filter passes what moves the motor and
stops most of the noise.  A filter of the motion alone, with these parameters, makes the
predictions.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.base import Estimate, OnlineEstimator, Tuning
from motor_sysid.estimation.online.despike import Sample
from motor_sysid.estimation.online.joint import JointFilter
from motor_sysid.estimation.online.learners.base import Learner
from motor_sysid.estimation.online.learners.forgetting import Forgetting
from motor_sysid.estimation.online.regressions import Regressions
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]


class Regressive(OnlineEstimator):
    """Regressions of every balance, and a filter of the motion for the predictions.

    Parameters
    ----------
    model, dt, outputs, tuning:
        See `OnlineEstimator`.
    learner:
        The rule by which each regression learns.

    Attributes
    ----------
    tracker, regressions:
        The filter of the motion, and the regressions.

    Raises
    ------
    UserError
        If a signal that an equation needs is not measured.
    """

    def __init__(
        self,
        model: Model,
        dt: float,
        outputs: Sequence[str],
        tuning: Tuning,
        learner: type[Learner] = Forgetting,
    ) -> None:
        self.tracker = motion_filter(model, dt, outputs, tuning)
        self.regressions = Regressions(model, dt, outputs, tuning, learner)

    def restart(self, y: Array) -> None:
        """Take up the motion anew; what was learned stays."""
        self.tracker.restart(y)
        self.regressions.restart(y)

    def step(self, time: float, h: float, u: Array, y: Array) -> Array:
        """Predict with the present parameters, then learn from the sample."""
        before = self.tracker.state
        predicted = self.tracker.step(time, h, u, y)
        sample = Sample(time, h, u, y, before, self.tracker.state)
        if self.regressions.push(sample, self.tracker.sizes):
            self.tracker.motion.set_values(self.regressions.used)
        return predicted

    def estimate(self) -> dict[str, Estimate]:
        """Return the free parameters; those that no equation holds are as they were."""
        return self.regressions.estimate()

    def covariance(self) -> Array:
        """Return the covariance of all coefficients, equation by equation."""
        return self.regressions.covariance()


def motion_filter(model: Model, dt: float, outputs: Sequence[str], tuning: Tuning) -> JointFilter:
    """Return a filter that estimates the motion and sensor offsets, but no parameter."""
    biases = [o.bias for o in model.kind.outputs if o.bias and model.parameters[o.bias].free]
    return JointFilter(model, dt, outputs, tuning, biases)
