"""The measurement update of the dual extended Kalman filter: two filters, each with its gain.

One filter estimates the motion as if the parameters were known, the other the parameters from the
same innovations ``e``.  With the covariances ``P_x`` of the motion and ``P_z`` of the parameters,
and the sensitivity ``W`` of the estimated motion to the parameters,

    C = H W + B                               how the outputs depend on the parameters,
    K_x = P_x H' (H P_x H' + R)^-1,           S = C P_z C' + H P_x H' + R,
    K_z = P_z C' S^-1 H K_x,                  W <- W - K_x C.

The motion is not moved along with the parameters: what it was given by the old ones has to fade
first, and meanwhile the same error shows again in every innovation.  ``H K_x`` is the part of an
innovation that the motion takes up at once; the parameters take no more of it, so that they have
made one whole correction by the time that it has faded.  (With the whole of it each time, as
``H K_x = 1`` would have it, corrections overshoot, and where physics is missing the filter runs
away.)  (Nelson and Stear 1976,
doi:10.1109/TAC.1976.1101185; Wan and Nelson, Dual extended Kalman filter methods, in Haykin,
Kalman Filtering and Neural Networks, 2001, with the recursion of the total derivative ``W``.)

From sample to sample both covariances travel as that of the pair, ``P_x + W P_z W'`` and
``W P_z``, whose prediction is exactly that of the two filters and of ``W``.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.algebra import joseph
from motor_sysid.machine_code import kept

Array = NDArray[np.float64]

_LEAST = 1e-14
"""Smallest share of a state's variance that is not put down to the parameters."""


class DualUpdate:
    """Two coupled measurement updates.

    Parameters
    ----------
    motor, states, outputs:
        Entries of the motor's state, of the whole, and most measurements at a time.
    """

    def __init__(self, motor: int, states: int, outputs: int) -> None:
        self._motor = motor
        for count in range(1, outputs + 1):  # compile now: it may take seconds
            rows = np.ones((count, states))
            self(np.ones(states), np.eye(states), np.ones(count), rows, np.ones(count))

    def __call__(
        self, x: Array, p: Array, z: Array, rows: Array, noise: Array
    ) -> tuple[Array, Array]:
        """Return state and covariance; see `motor_sysid.estimation.online.algebra.joseph`."""
        if self._motor == x.size:
            return joseph(x, p, z, rows, noise)  # type: ignore[no-any-return]
        return _update(self._motor, x, p, z, rows, noise)  # type: ignore[no-any-return]


@kept(error_model='numpy')
def _update(n, x, p, z, rows, noise):  # type: ignore[no-untyped-def]
    """Return state (d,) and covariance (d, d) after a measurement."""
    size = np.sqrt(np.diag(p)[n:])
    known = np.ascontiguousarray(p[n:, n:])
    cross = np.ascontiguousarray(p[:n, n:])
    w = np.linalg.solve(known / np.outer(size, size), (cross / size).T).T / size
    motion = np.ascontiguousarray(p[:n, :n]) - w @ known @ w.T
    for i in range(n):
        motion[i, i] = max(motion[i, i], _LEAST * p[i, i])
    h = np.ascontiguousarray(rows[:, :n])
    c = h @ w + np.ascontiguousarray(rows[:, n:])
    innovation, r = z - rows @ x, np.diag(noise)
    spread = h @ motion @ h.T + r
    gain = motion @ h.T @ np.linalg.inv(spread)
    slow = known @ c.T @ np.linalg.inv(c @ known @ c.T + spread) @ (h @ gain)
    motion, known = _joseph(motion, gain, h, r), _joseph(known, slow, c, spread)
    w = w - gain @ c
    state, whole = x.copy(), np.empty_like(p)
    state[:n] += gain @ innovation
    state[n:] += slow @ innovation
    whole[:n, :n] = motion + w @ known @ w.T
    whole[:n, n:] = w @ known
    whole[n:, :n] = whole[:n, n:].T
    whole[n:, n:] = known
    return state, whole


@kept(error_model='numpy')
def _joseph(p, gain, rows, noise):  # type: ignore[no-untyped-def]
    left = np.eye(p.shape[0]) - gain @ rows
    return left @ p @ left.T + gain @ noise @ gain.T
