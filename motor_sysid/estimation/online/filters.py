"""State-variable filter: a signal and its derivative through the same low pass.

Every signal of an equation is passed through ``F(s) = w^2 / (s + w)^2``; the equation then holds
between the filtered signals, and ``s F(s)`` gives the filtered derivative without differencing.
(Young 1981, doi:10.1016/0005-1098(81)90082-0; Garnier and Wang, Identification of Continuous-time
Models from Sampled Data, 2008.)
"""

import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept

Array = NDArray[np.float64]


class StateVariableFilter:
    """Second-order filter of several signals, exact for signals that are straight in a sample.

    Parameters
    ----------
    width:
        Number of signals.
    bandwidth:
        Corner ``w`` in rad/s.

    Attributes
    ----------
    value, slope:
        (width,) filtered signals and their derivatives.
    bandwidth, gains:
        What `advance` takes besides.
    """

    def __init__(self, width: int, bandwidth: float) -> None:
        self.bandwidth = bandwidth
        self.value, self.slope = np.zeros(width), np.zeros(width)
        self.gains = np.zeros(9)

    def start(self, signal: Array) -> None:
        """Settle at constant signals (width,)."""
        self.value[:], self.slope[:] = signal, 0.0

    def step(self, first: Array, last: Array, h: float) -> None:
        """Advance by `h` s, in which the signals go straight from `first` to `last`."""
        advance(self.value, self.slope, self.gains, self.bandwidth, first, last, h)


@kept()
def advance(value, slope, gains, bandwidth, first, last, h):  # type: ignore[no-untyped-def]
    """Advance filtered signals and their derivatives, in place; see `StateVariableFilter`.

    `gains` (9,) hold the transition of (value, slope), the gains of both ends of the sample, and
    the length that they are for.
    """
    if gains[8] != h:
        _solve(bandwidth, h, gains)
    for k in range(value.size):
        v, w = value[k], slope[k]
        value[k] = gains[0] * v + gains[1] * w + gains[4] * first[k] + gains[5] * last[k]
        slope[k] = gains[2] * v + gains[3] * w + gains[6] * first[k] + gains[7] * last[k]


@kept()
def _solve(w, h, gains):  # type: ignore[no-untyped-def]
    a = w * h
    e = math.exp(-a)
    rise, rate = 1 - e * (1 + a), w * a * e
    ramp, ramp_rate = 1 - 2 * (1 - e) / a + e, rise / h
    gains[0], gains[1], gains[2], gains[3] = e * (1 + a), e * h, -e * w * a, e * (1 - a)
    gains[4], gains[5], gains[6], gains[7] = rise - ramp, ramp, rate - ramp_rate, ramp_rate
    gains[8] = h
