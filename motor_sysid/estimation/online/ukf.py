"""The unscented transform of motion and parameters through a sample.

Sigma points (filterpy's) around the estimate go through the simulator's own step, each with the
parameters that it has.  What comes out is written as the straight line that fits them best,
``A = P_yx P^-1``, and what that leaves over: statistical linearization, whose mean and covariance
are those of the unscented transform.  (Julier, Uhlmann and Durrant-Whyte 2000,
doi:10.1109/9.847726; Lefebvre, Bruyninckx and De Schutter 2002, doi:10.1109/TAC.2002.800742, on
the equivalence.)

The points lie ``sqrt(3)`` standard deviations away, however many states there are; the covariance
is taken around the middle point, as the first paper proposes for that: it stays positive.  Outputs
are states plus offsets, so that the measurement update is that of the extended filter.
"""

from filterpy.kalman import JulierSigmaPoints
import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.algebra import solve_upper
from motor_sysid.estimation.online.motion import Motion, Move
from motor_sysid.machine_code import kept

Array = NDArray[np.float64]

_REACH = np.sqrt(3.0)
"""Distance of the points in standard deviations: right for the fourth moment of a Gaussian."""


class Unscented:
    """The unscented transform; see `motor_sysid.estimation.online.joint.Transform`.

    Parameters
    ----------
    motor, moved:
        States of the motor and parameters that move it.
    """

    def __init__(self, motor: int, moved: int) -> None:
        self._n, self._size = motor, motor + moved
        self._points = JulierSigmaPoints(
            self._size, _REACH**2 - self._size, sqrt_method=_root_upper
        )
        solve_upper(_root_upper(np.eye(self._size)), np.ones((self._size, motor)))

    @np.errstate(over='ignore', invalid='ignore')  # a point that runs away spoils the sum: unsound
    def __call__(
        self, motion: Motion, x: Array, cov: Array, steps: Array, u: Array, time: float, h: float
    ) -> Move:
        """Return where the sample leads from the estimate ``x`` with covariance ``cov``."""
        n, m = self._n, self._size
        points = self._points.sigma_points(x[:m], cov[:m, :m])
        after, by_force = motion.scatter(points[:, :n], points[:, n:], u, time, h)
        up, down = after[1 : m + 1], after[m + 1 :]
        root = _root_upper(cov[:m, :m])  # not from the points: a small step is lost beside x
        slope = solve_upper(root, (up - down) / (2 * _REACH)).T
        bend = (0.5 * (up + down) - after[0]) / _REACH
        state = self._points.Wm @ after
        return Move(state, np.ascontiguousarray(slope), by_force, np.ascontiguousarray(bend.T))


def _root_upper(p: Array) -> Array:
    """Return an upper triangular U (d, d) with U' U = p, to the accuracy that `p` has."""
    root: Array = _root(np.ascontiguousarray(p))
    return root


@kept(error_model='numpy')
def _root(p):  # type: ignore[no-untyped-def]
    """Return the Cholesky factor, with pivots that rounding made negative at their least."""
    d = p.shape[0]
    upper = np.zeros((d, d))
    for i in range(d):
        left = p[i, i]
        for k in range(i):
            left -= upper[k, i] ** 2
        upper[i, i] = np.sqrt(max(left, 1e-14 * p[i, i], 1e-280))
        for j in range(i + 1, d):
            value = p[i, j]
            for k in range(i):
                value -= upper[k, i] * upper[k, j]
            upper[i, j] = value / upper[i, i]
    return upper
