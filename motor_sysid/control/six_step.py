"""Six-step commutation: two phases drive, by Hall sector, and one is off.

In a sector the back-EMF between the two driving phases is flat, twice that of a phase, so that
they are a DC motor with ``2 R``, ``2 L`` and ``2 k_e``.  The current of that motor is controlled
by internal model control, with its back-EMF fed forward:

    u = a 2 L e + a 2 R integral(e) + 2 k_e omega

A positive voltage chops the leg that drives forward, and the other stays low; a negative one the
other way round.  (Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives, 2010,
chapter 11.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math

from motor_sysid.physics.model import Model

FORWARD = ((1, 0), (2, 0), (2, 1), (0, 1), (0, 2), (1, 2))
"""Phases (0 is a) of positive and negative current for forward torque, by sector 1 to 6."""

OFF = math.nan
"""Voltage of a leg whose two switches are open."""


@dataclass(frozen=True)
class SixStepLoop:
    """What the current loop of six-step drive is made from.

    Attributes
    ----------
    R, L, k_e:
        Resistance (ohm), inductance (H) and back-EMF constant (V s/rad of the shaft) of a phase.
    bandwidth:
        Of the closed current loop, rad/s.
    current_limit:
        Largest current that is asked for, A.
    """

    R: float
    L: float
    k_e: float
    bandwidth: float
    current_limit: float

    @classmethod
    def of(cls, model: Model, bandwidth: float, current_limit: float) -> 'SixStepLoop':
        """Return the loop for a model of a BLDC motor."""
        return cls(model['R'], model['L'], model['k_e'], bandwidth, current_limit)


def pair_current(sector: int, abc: Sequence[float]) -> float:
    """Return the current through the bridge, A, positive for forward torque.

    It is the largest of the three: while a phase that was just left still frees itself, the one
    that goes on driving shows what the pair carries.
    """
    into, out = FORWARD[sector - 1]
    return math.copysign(max(abs(i) for i in abc), abc[into] - abc[out])


def pair_legs(sector: int, voltage: float) -> tuple[float, float, float]:
    """Return the voltages of the legs above the negative rail, V; `OFF` for the one that is off.

    Parameters
    ----------
    voltage:
        Across the two phases that drive, V, positive for forward torque.
    """
    into, out = FORWARD[sector - 1]
    v = [OFF, OFF, OFF]
    v[into], v[out] = max(voltage, 0.0), max(-voltage, 0.0)
    return v[0], v[1], v[2]


class SixStep:
    """The six-step drive with its memory: measured phase currents to leg voltages.

    Parameters
    ----------
    loop:
        Its gains.
    supply:
        Voltage of the bridge, V.
    dt:
        Control period, s.
    """

    def __init__(self, loop: SixStepLoop, supply: float, dt: float) -> None:
        self.loop, self.supply, self.dt = loop, supply, dt
        self.reset()

    def reset(self) -> None:
        """Forget the integral."""
        self._sum = 0.0

    def step(
        self, abc: Sequence[float], sector: int, omega: float, want: float
    ) -> tuple[float, float, float]:
        """Return the leg voltages for the next period, V; `OFF` for the leg that is off.

        Parameters
        ----------
        abc:
            Measured phase currents, A.
        sector:
            Hall sector, 1 to 6.
        omega:
            Speed of the shaft, rad/s.
        want:
            Current to follow, A, positive for forward torque.
        """
        loop, a = self.loop, self.loop.bandwidth
        want = min(max(want, -loop.current_limit), loop.current_limit)
        error = want - pair_current(sector, abc)
        asked = 2 * a * loop.L * error + self._sum + 2 * loop.k_e * omega
        given = min(max(asked, -self.supply), self.supply)
        self._sum += loop.R * self.dt * (2 * a * error + (given - asked) / loop.L)
        return pair_legs(sector, given)
