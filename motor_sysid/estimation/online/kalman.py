"""Kalman filters over the motion and its parameters; a variant gives its update and transform.

A nonlinear filter that starts far from the truth wanders for seconds.  So the first second goes to
recursive least squares, which are linear and know no bad start; the filter goes on from what they
found.  Where a signal that they need is not measured, the filter starts from the model.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.estimation.online.base import Estimate, OnlineEstimator, Tuning
from motor_sysid.estimation.online.joint import (
    JointFilter,
    linearized,
    MakeTransform,
    MakeUpdate,
)
from motor_sysid.estimation.online.regressive import Regressive
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

_WARM = 1.0


class Kalman(OnlineEstimator):
    """Joint filter of motion and parameters.

    Parameters
    ----------
    model, dt, outputs, tuning:
        See `OnlineEstimator`.
    update, transform:
        See `JointFilter`.
    """

    def __init__(
        self,
        model: Model,
        dt: float,
        outputs: Sequence[str],
        tuning: Tuning,
        update: MakeUpdate,
        transform: MakeTransform = linearized,
    ) -> None:
        self._joint = JointFilter(model, dt, outputs, tuning, update=update, transform=transform)
        self._start: Regressive | None = None
        self._driven = 0.0
        try:
            self._start = Regressive(model, dt, outputs, tuning)
        except UserError:
            self._driven = _WARM

    @property
    def _now(self) -> 'Regressive | JointFilter':
        return self._start or self._joint

    def restart(self, y: Array) -> None:
        """Take up the motion anew; parameters keep what is known of them."""
        self._now.restart(y)

    def step(self, time: float, h: float, u: Array, y: Array) -> Array:
        """Predict, note the prediction, and correct."""
        predicted = self._now.step(time, h, u, y)
        if self._start is not None:
            self._driven += h if np.any(u != 0) else 0.0
            if self._driven >= _WARM:
                self._joint.take_over(self._start.tracker, self._start.regressions.settled())
                self._start = None
        return predicted

    def estimate(self) -> dict[str, Estimate]:
        """Return the free parameters with their standard deviations."""
        return self._now.estimate()

    def covariance(self) -> Array:
        """Return the covariance of states, then parameters."""
        return self._now.covariance()
