"""The controller that both the true plant and the models run in: a sampled PID, known exactly."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept

Array = NDArray[np.float64]

DT = 0.01
"""Sample time of controller and records, s."""

FILTER = 0.01
"""Time constant of the filter of the derivative, s."""


@dataclass(frozen=True)
class Loop:
    """How the input comes about.

    Attributes
    ----------
    kp, ki, kd:
        Gains of the controller; all zero for an open loop.
    inside:
        Whether the controller sees the delayed output; else the output before the delay.
    """

    kp: float = 0.0
    ki: float = 0.0
    kd: float = 0.0
    inside: bool = True

    @property
    def closed(self) -> bool:
        """Whether there is a controller."""
        return bool(self.kp or self.ki or self.kd)

    @property
    def gains(self) -> Array:
        """The three gains (3,)."""
        return np.array([self.kp, self.ki, self.kd])


@kept()
def pid(error, gains, memory):  # type: ignore[no-untyped-def]
    """Return the input for an error; `memory` (3,) is integral, derivative and error before."""
    kp, ki, kd = gains
    memory[1] = (FILTER * memory[1] + kd * (error - memory[2])) / (FILTER + DT)
    memory[2] = error
    u = kp * error + memory[0] + memory[1]
    memory[0] += ki * DT * error
    return u
