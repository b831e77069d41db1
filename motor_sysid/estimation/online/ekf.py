"""Extended Kalman filter over the motion and, jointly, its parameters.

An extended filter that starts far from the truth wanders for seconds.  So the first second goes to
recursive least squares, which are linear and know no bad start; the filter goes on from what they
found.  Where a signal that they need is not measured, the filter starts from the model.
filterpy does the measurement update, in Joseph's form.
"""

from collections.abc import Sequence

from filterpy.kalman import ExtendedKalmanFilter
import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.estimation.online.base import Estimate, OnlineEstimator, Tuning
from motor_sysid.estimation.online.joint import JointFilter
from motor_sysid.estimation.online.rls import Rls
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

_WARM = 1.0


class Ekf(OnlineEstimator):
    """Joint filter of motion and parameters.

    Parameters
    ----------
    model, dt, outputs, tuning:
        See `OnlineEstimator`.
    """

    def __init__(self, model: Model, dt: float, outputs: Sequence[str], tuning: Tuning) -> None:
        self._joint = JointFilter(model, dt, outputs, tuning, update=FilterpyUpdate)
        self._start: Rls | None = None
        self._driven = 0.0
        try:
            self._start = Rls(model, dt, outputs, tuning)
        except UserError:
            self._driven = _WARM

    @property
    def _now(self) -> 'Rls | JointFilter':
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


class FilterpyUpdate:
    """The measurement update of filterpy's extended Kalman filter.

    Parameters
    ----------
    states, outputs:
        Entries of the state, and most measurements at a time.
    """

    def __init__(self, states: int, outputs: int) -> None:
        self._filter = ExtendedKalmanFilter(states, outputs)

    def __call__(
        self, x: Array, p: Array, z: Array, rows: Array, noise: Array
    ) -> tuple[Array, Array]:
        """Return state and covariance; see `motor_sysid.estimation.online.algebra.joseph`."""
        f = self._filter
        f.x, f.P = x, p
        f.update(z, lambda state: rows, lambda state: rows @ state, np.diag(noise))
        return f.x, f.P
