"""Three-phase machines: the numbers of a true one, and real ones from data sheets."""

from dataclasses import dataclass
import math
from typing import NamedTuple


class Machine(NamedTuple):
    """A three-phase machine with everything that may be hidden in it; zero switches a part off.

    Attributes
    ----------
    R, L_d, L_q:
        Resistance of a phase, ohm, and inductances on and across the magnet, H.
    k_e:
        Back-EMF constant of a phase, peak (or flat top) volts per rad/s of the shaft.
    pole_pairs:
        Electrical turns per turn of the shaft.
    J, b:
        Inertia, kg m^2, and viscous friction, N m s/rad.
    corner:
        0: sinusoidal back-EMF.  Otherwise a trapezoid, flat over 120 degrees but for its rounded
        corners, each of which takes this share of the 30 degrees from zero to the top.
    fifth, seventh:
        Harmonics of the back-EMF beside that, in parts of the fundamental or of the flat top.
    tau_c, tau_s, omega_s:
        Coulomb friction, its rise near standstill, N m, and ``tau_s exp(-(omega/omega_s)^2)``.
    drag, tau_l:
        ``drag omega |omega|``, N m s^2/rad^2, and a constant load torque, N m.
    cogging, cogging_angle, order:
        ``cogging sin(order theta + cogging_angle)``, N m, rad, waves per turn of the shaft.
    step_torque, step_time:
        Load torque that comes on, N m, and when, s.
    soft, i_soft:
        Excess of both inductances without current, relative, and the current (A) at which half of
        it is gone: ``L (1 + soft 2^-((i / i_soft)^2))`` on either axis.
    heat, t_th:
        Relative rise of resistance per stored loss energy, 1/J, and thermal time constant, s.
    mu:
        Dry friction per torque of the currents.
    swing, swing_rate, swing_angle:
        Load torque ``swing sin(swing_rate t + swing_angle)``, N m, rad/s, rad.
    step_inertia:
        Inertia that joins the rotor at `step_time` at the rotor's speed, kg m^2.
    J_load, spring, damper:
        Inertia behind a spring, kg m^2 (0: none), N m/rad, and damper of the shaft, N m s/rad.
    """

    R: float
    L_d: float
    L_q: float
    k_e: float
    pole_pairs: float
    J: float
    b: float
    corner: float = 0.0
    fifth: float = 0.0
    seventh: float = 0.0
    tau_c: float = 0.0
    tau_s: float = 0.0
    omega_s: float = 1.0
    drag: float = 0.0
    tau_l: float = 0.0
    cogging: float = 0.0
    cogging_angle: float = 0.0
    order: float = 0.0
    step_torque: float = 0.0
    step_time: float = 0.0
    soft: float = 0.0
    i_soft: float = 1.0
    heat: float = 0.0
    t_th: float = 1.0
    mu: float = 0.0
    swing: float = 0.0
    swing_rate: float = 0.0
    swing_angle: float = 0.0
    step_inertia: float = 0.0
    J_load: float = 0.0
    spring: float = 0.0
    damper: float = 0.0


class Bridge(NamedTuple):
    """A three-leg inverter, averaged over its switching period.

    Attributes
    ----------
    supply:
        V.
    dead:
        Voltage that dead time takes from a leg against its current, V: supply times dead time
        times switching frequency.
    diode:
        Forward voltage of the free-wheeling diodes, V.
    """

    supply: float
    dead: float = 0.0
    diode: float = 0.7


@dataclass(frozen=True)
class MachineSheet:
    """A machine as its data sheet describes it.

    Attributes
    ----------
    name, source:
        Machine, and where the values come from.
    machine:
        Without load, friction or anything hidden.
    supply, current:
        Nominal supply, V, and rated (peak) phase current, A.
    """

    name: str
    source: str
    machine: Machine
    supply: float
    current: float

    @property
    def top_speed(self) -> float:
        """Speed in rad/s at which the back-EMF takes all of the supply."""
        reach = 2.0 if self.machine.corner else math.sqrt(3)
        return self.supply / (reach * self.machine.k_e)


def _sinusoidal(
    r: float, l_d: float, l_q: float, flux: float, pole_pairs: int, inertia: float, b: float
) -> Machine:
    return Machine(r, l_d, l_q, flux * pole_pairs, pole_pairs, inertia, b)


def _block(
    r_pair: float, l_pair: float, k_t: float, pole_pairs: int, inertia: float, b: float
) -> Machine:
    """Return a machine from what is measured between two terminals."""
    inductance = l_pair / 2
    return Machine(
        r_pair / 2, inductance, inductance, k_t / 2, pole_pairs, inertia, b, corner=0.3
    )


_TI = 'Texas Instruments InstaSPIN, user_motor.h, from its motor identification'
_MAXON = 'maxon catalogue, EC 45 flat, page'
_NO_LOAD = 'viscous friction from half of the no-load current'

PMSM_SHEETS = (
    MachineSheet(
        'Teknic M-2310P-LN-04K',
        f'{_TI} (Rs, Ls, rated flux in V/Hz), inertia ibid.; viscous friction chosen here',
        _sinusoidal(0.393955578, 190.442806e-6, 190.442806e-6, 0.0399353318 / (2 * math.pi), 4,
                    7.06154e-6, 5e-6),
        24.0, 6.6,
    ),
    MachineSheet(
        'Anaheim BLY172S-24V-4000',
        f'{_TI}; inertia 0.00068 oz in s^2 from the data sheet, friction as in the parameter set '
        'of the MathWorks Motor Control Blockset',
        _sinusoidal(0.417878777, 719.0173e-6, 719.0173e-6, 0.0327013217 / (2 * math.pi), 4,
                    4.8018552e-6, 9.6037e-6),
        24.0, 5.0,
    ),
    MachineSheet(
        'salient traction machine',
        'github.com/dweggg/Inverter, Control/FOC_DQ0_parameters.m: Rs, Ld, Lq, lambda, n, J, B',
        _sinusoidal(0.115, 0.52e-3, 1.26e-3, 0.10642288, 4, 0.01, 0.005),
        300.0, 100.0,
    ),
)  # fmt: skip
"""Sinusoidal machines, two with surface magnets and one with inner ones."""

BLDC_SHEETS = (
    MachineSheet(
        'maxon EC 45 flat 50 W 24 V',
        f'{_MAXON} 321, 24 V winding, lines 10 to 12 and 16; {_NO_LOAD}',
        _block(0.942, 0.363e-3, 36e-3, 8, 135e-7, 0.5 * 36e-3 * 0.238 / 654.5),
        24.0, 2.52,
    ),
    MachineSheet(
        'maxon EC 45 flat 70 W 24 V',
        f'{_MAXON} 324, 24 V winding, lines 10 to 12 and 16; {_NO_LOAD}',
        _block(0.573, 0.301e-3, 40.4e-3, 8, 181e-7, 0.5 * 40.4e-3 * 0.270 / 586.4),
        24.0, 3.29,
    ),
    MachineSheet(
        'Anaheim BLY172S-24V-4000',
        'data sheet: 0.8 ohm, 1.2 mH and 3.35 V rms per 1000 rpm between terminals, 8 poles, '
        '0.00068 oz in s^2; friction as above, its back-EMF taken as a trapezoid',
        _block(0.8, 1.2e-3, math.sqrt(2) * 3.35 / (1000 * 2 * math.pi / 60), 4, 4.8018552e-6,
               9.6037e-6),
        24.0, 3.5,
    ),
)  # fmt: skip
"""Machines for six-step drive; their sheets tell resistance, inductance and torque constant
between two terminals."""
