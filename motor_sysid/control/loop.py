"""A speed loop around the linear core of a motor, as two filters: fast to evaluate for planning.

With the plant ``omega = P u + d`` and the controller ``u = C (r - omega)`` the loop answers
``u = C / (1 + P C) (r - d)``.  ``P`` is the exact zero-order-hold discretisation of the core, and
``C`` the PI controller of `motor_sysid.control.pid` without its limits.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

from motor_sysid.control.pid import PidGains
from motor_sysid.control.tuning import reduce_to_speed, speed_pi
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

SLOWEST = 0.1
"""Closed-loop time constant that is not exceeded without need, s."""

SAMPLES = 20.0
SETTLED = 5.0
"""Closed-loop time constant at least in samples, and in slowest electrical time constants."""


@dataclass(frozen=True)
class SpeedLoop:
    """A PI speed loop around a linear motor.

    Attributes
    ----------
    gains:
        Of the controller.
    plant, closed:
        (numerator, denominator) of P and of C / (1 + P C) in powers of 1/z.
    """

    gains: PidGains
    plant: tuple[Array, Array]
    closed: tuple[Array, Array]

    def speed(self, u: Array) -> Array:
        """Return (N,) speed of the linear core under an input (N,)."""
        return np.asarray(lfilter(*self.plant, u))

    def answer(self, error: Array) -> Array:
        """Return (N,) input for reference minus disturbance (N,)."""
        return np.asarray(lfilter(*self.closed, error))


def speed_loop(model: Model, dt: float) -> SpeedLoop:
    """Return a speed loop about as fast as the motor itself, so that steps ask for no overshoot.

    Raises
    ------
    UserError
        If the motor has more than one input.
    """
    if len(model.kind.arguments) != 1:
        raise UserError(f'experiments need a motor with one input, not a {model.kind.title}')
    reduced = reduce_to_speed(model)
    time = min(reduced.time_constant, SLOWEST)
    time = max(time, SETTLED * reduced.neglected, SAMPLES * dt)
    gains = speed_pi(model, time, np.inf)
    over, under = _discrete(model, dt)
    c_over = np.array([gains.kp + gains.ki * dt, -gains.kp])
    c_under = np.array([1.0, -1.0])
    whole = np.polyadd(np.polymul(c_under, under), np.polymul(c_over, over))
    answer = np.asarray(np.polymul(c_over, under), dtype=np.float64)
    return SpeedLoop(gains, (over, under), (answer, np.asarray(whole, dtype=np.float64)))


def _discrete(model: Model, dt: float) -> tuple[Array, Array]:
    """Return numerator and denominator from the held input to the speed."""
    kind = model.kind
    values = {name: np.array([value]) for name, value in model.parameters.values().items()}
    a, b = (part[0] for part in kind.matrices(values)[:2])
    inner = [j for j, name in enumerate(kind.states) if name != 'theta']
    size = len(inner)
    both = np.zeros((size + 1, size + 1))
    both[:size, :size], both[:size, size] = a[np.ix_(inner, inner)] * dt, b[inner, 0] * dt
    held = expm(both)
    step, drive = held[:size, :size], held[:size, size]
    row = np.zeros(size)
    row[[kind.states[j] for j in inner].index('omega')] = 1.0
    under = np.poly(step).real
    # numerator by the matrix determinant lemma: det(zI - A + b c) - det(zI - A)
    over = np.poly(step - np.outer(drive, row)).real - under
    return np.asarray(over), np.asarray(under)
