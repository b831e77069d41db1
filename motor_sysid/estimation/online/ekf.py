"""The measurement update of the extended Kalman filter over motion and parameters jointly.

filterpy does it, in Joseph's form.  (Ljung 1979, Asymptotic behavior of the extended Kalman filter
as a parameter estimator for linear systems, IEEE Trans. Automatic Control 24,
doi:10.1109/TAC.1979.1101943.)
"""

from filterpy.kalman import ExtendedKalmanFilter
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class FilterpyUpdate:
    """The measurement update of filterpy's extended Kalman filter.

    Parameters
    ----------
    motor, states, outputs:
        Entries of the motor's state, of the whole, and most measurements at a time.
    """

    def __init__(self, motor: int, states: int, outputs: int) -> None:
        self._filter = ExtendedKalmanFilter(states, outputs)

    def __call__(
        self, x: Array, p: Array, z: Array, rows: Array, noise: Array
    ) -> tuple[Array, Array]:
        """Return state and covariance; see `motor_sysid.estimation.online.algebra.joseph`."""
        f = self._filter
        f.x, f.P = x, p
        f.update(z, lambda state: rows, lambda state: rows @ state, np.diag(noise))
        return f.x, f.P
