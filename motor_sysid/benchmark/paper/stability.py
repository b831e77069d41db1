"""What the printed closed loop does: it is unstable.

L(s) = (Kp + Ki/s + Kd s) b e^(-tau s) / (a2 s^2 + a1 s + a0)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from motor_sysid.benchmark.paper.control import Loop
from motor_sysid.benchmark.paper.plant import TRUE

Array = NDArray[np.float64]

_FINE = np.linspace(1e-3, 300.0, 400_001)


@dataclass(frozen=True)
class Stability:
    """Stability of a loop with the delay inside.

    Attributes
    ----------
    crossover:
        Where the loop gain is 1 for the last time, rad/s.
    delay_margin:
        Longest delay that keeps it stable, s.
    unstable_poles:
        Poles in the right half plane with the delay of the plant.
    gain_limit:
        Factor on all gains under which the loop is stable with that delay.
    """

    crossover: float
    delay_margin: float
    unstable_poles: int
    gain_limit: float


def stability(loop: Loop, plant: Array = TRUE) -> Stability:
    """Return the stability of a loop around a plant (5,); the derivative is not filtered here."""
    size = np.abs(_gain(_FINE, loop, plant, 0.0))
    last = int(np.flatnonzero(size > 1.0)[-1])
    crossover = brentq(
        lambda w: float(abs(_gain(np.array([w]), loop, plant, 0.0)[0])) - 1.0,
        _FINE[last], _FINE[last + 1],
    )  # fmt: skip
    phase = np.angle(_gain(np.array([crossover]), loop, plant, 0.0)[0])
    late = _gain(_FINE, loop, plant, float(plant[4]))
    turns = np.flatnonzero((late.imag[:-1] * late.imag[1:] < 0) & (late.real[:-1] < 0))
    worst = float(np.max(np.abs(late[turns]), initial=0.0))
    return Stability(
        float(crossover), float((phase + np.pi) / crossover), _unstable(loop, plant), 1.0 / worst
    )


def _gain(omega: Array, loop: Loop, plant: Array, tau: float) -> NDArray[np.complex128]:
    s = 1j * omega
    a0, a1, a2, b, _ = plant
    control = loop.kp + loop.ki / s + loop.kd * s
    gain: NDArray[np.complex128] = control * b * np.exp(-tau * s) / (a2 * s**2 + a1 * s + a0)
    return gain


def _unstable(loop: Loop, plant: Array) -> int:
    """Count zeros of ``1 + L`` in the right half plane by the argument principle.

    ``s (a2 s^2 + a1 s + a0) + (Kd s^2 + Kp s + Ki) b e^(-tau s)`` has no poles, and on a large
    half circle it is ``a2 s^3``: the rest of its turn along the axis counts the zeros.
    """
    omega = np.linspace(0.0, 2000.0, 200_001)
    s = 1j * omega
    a0, a1, a2, b, tau = plant
    value = s * (a2 * s**2 + a1 * s + a0)
    value += (loop.kd * s**2 + loop.kp * s + loop.ki) * b * np.exp(-tau * s)
    turn = np.unwrap(np.angle(value))
    return round(float((3 * np.pi / 2 - (turn[-1] - turn[0])) / np.pi))
