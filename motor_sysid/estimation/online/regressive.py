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
from motor_sysid.estimation.online.joint import JointFilter, sensor_parameters
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

    bridges = True

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
        self._shown = [name for name in model.kind.shown if model.parameters[name].free]

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
            if self._shown:
                known = self.tracker.estimate()
                self.regressions.set_sensors({n: known[n].value for n in self._shown})
        return predicted

    def estimate(self) -> dict[str, Estimate]:
        """Return the free parameters; those that no equation holds are as they were."""
        found, tracked = self.regressions.estimate(), self.tracker.estimate()
        return {name: tracked[name] if name in self._shown else one for name, one in found.items()}

    def covariance(self) -> Array:
        """Return the covariance of all coefficients, equation by equation."""
        return self.regressions.covariance()


def motion_filter(model: Model, dt: float, outputs: Sequence[str], tuning: Tuning) -> JointFilter:
    """Return a filter that estimates the motion and sensor offsets, but no parameter."""
    biases = [name for name in sensor_parameters(model) if model.parameters[name].free]
    return JointFilter(model, dt, outputs, tuning, biases)
