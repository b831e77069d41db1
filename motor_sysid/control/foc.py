"""Field-oriented control of a PMSM: current loops in the rotor's frame, and the bridge's reach.

The loops cancel the machine's poles and couplings (internal model control; Harnefors and Nee,
IEEE Trans. Ind. Appl. 34 (1998), doi:10.1109/28.658735): with ``a`` the bandwidth

    u_d = a L_d e_d + a R integral(e_d) - omega_e L_q i_q
    u_q = a L_q e_q + a R integral(e_q) + omega_e (L_d i_d + psi_f)

so that each current follows as ``a / (s + a)``.  Where the voltage does not suffice, d gets what
it asks for and q what is left of the circle, so that the flux stays in hand; the integrals fall
back to what was applied.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math

from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.signals.phases import inverse_park, park

FASTEST = 0.3
"""Bandwidth times control period up to which the sampled loop behaves like the continuous one."""


@dataclass(frozen=True)
class CurrentLoop:
    """What the current loops are made from.

    Attributes
    ----------
    R, L_d, L_q, psi_f:
        Ohm, H, H and V s, as the controller believes them.
    bandwidth:
        Of the closed current loops, rad/s.
    """

    R: float
    L_d: float
    L_q: float
    psi_f: float
    bandwidth: float

    @classmethod
    def of(cls, model: Model, bandwidth: float) -> 'CurrentLoop':
        """Return the loop for a model of a PMSM."""
        return cls(model['R'], model['L_d'], model['L_q'], model['psi_f'], bandwidth)


def voltage_limit(supply: float) -> float:
    """Return the longest voltage vector that can turn in every direction, V.

    Space-vector modulation reaches ``supply / sqrt(3)`` (the circle within the hexagon), 15 % more
    than sines alone (van der Broeck et al., IEEE Trans. Ind. Appl. 24 (1988),
    doi:10.1109/28.87265).
    """
    return supply / math.sqrt(3)


def legs(u_a: float, u_b: float, u_c: float, supply: float) -> tuple[float, float, float]:
    """Return the voltages of the three legs above the negative rail, V, each in 0 to `supply`.

    What is common is chosen so that highest and lowest lie equally far from the rails, which is
    space-vector modulation with both zero vectors equally long.
    """
    middle = 0.5 * (supply - max(u_a, u_b, u_c) - min(u_a, u_b, u_c))
    a, b, c = (min(max(u + middle, 0.0), supply) for u in (u_a, u_b, u_c))
    return a, b, c


class Foc:
    """The current controller with its memory: measured phase currents to leg voltages.

    Parameters
    ----------
    loop:
        Its gains.
    supply:
        Voltage of the bridge, V.
    dt:
        Control period, s.
    ahead:
        Periods by which the angle is turned on to where the rotor will be, on average, while the
        voltage acts: half a one, and one more for a drive that computes for a period.

    Attributes
    ----------
    voltage_dq:
        Last voltage, V.

    Raises
    ------
    UserError
        If the bandwidth is too high for the period.
    """

    def __init__(
        self, loop: CurrentLoop, supply: float, dt: float, ahead: float = 0.5
    ) -> None:
        if not 0 < loop.bandwidth * dt <= FASTEST:
            raise UserError(
                f'a current loop of {loop.bandwidth:g} rad/s needs control periods of at most '
                f'{FASTEST / loop.bandwidth:.3g} s, not {dt:g} s; lower the bandwidth or control '
                'more often'
            )
        self.loop, self.supply, self.dt, self.ahead = loop, supply, dt, ahead
        self.limit = voltage_limit(supply)
        self.reset()

    def reset(self) -> None:
        """Forget the integrals."""
        self._sum_d = self._sum_q = 0.0
        self.voltage_dq = 0.0, 0.0

    def step(
        self,
        abc: Sequence[float],
        theta_e: float,
        omega_e: float,
        want_q: float,
        want_d: float = 0.0,
    ) -> tuple[float, float, float]:
        """Return the leg voltages for the next period, V above the negative rail.

        Parameters
        ----------
        abc:
            Measured phase currents, A.
        theta_e, omega_e:
            Electrical angle (rad) and speed (rad/s) now.
        want_q, want_d:
            Currents to follow, A.
        """
        i_d, i_q = park(abc[0], abc[1], abc[2], math.cos(theta_e), math.sin(theta_e))
        u_d, u_q = self._currents(want_d - i_d, want_q - i_q, i_d, i_q, omega_e)
        middle = theta_e + self.ahead * omega_e * self.dt
        u_a, u_b, u_c = inverse_park(u_d, u_q, math.cos(middle), math.sin(middle))
        return legs(u_a, u_b, u_c, self.supply)

    def _currents(
        self, e_d: float, e_q: float, i_d: float, i_q: float, omega_e: float
    ) -> tuple[float, float]:
        """Return u_d and u_q in V for the errors of the currents in A."""
        loop, a = self.loop, self.loop.bandwidth
        u_d = a * loop.L_d * e_d + self._sum_d - omega_e * loop.L_q * i_q
        u_q = a * loop.L_q * e_q + self._sum_q + omega_e * (loop.L_d * i_d + loop.psi_f)
        v_d = min(max(u_d, -self.limit), self.limit)
        left = math.sqrt(self.limit**2 - v_d**2)
        v_q = min(max(u_q, -left), left)
        self._sum_d += loop.R * self.dt * (a * e_d + (v_d - u_d) / loop.L_d)
        self._sum_q += loop.R * self.dt * (a * e_q + (v_q - u_q) / loop.L_q)
        self.voltage_dq = v_d, v_q
        return v_d, v_q
