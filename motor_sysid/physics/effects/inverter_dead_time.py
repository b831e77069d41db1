"""Dead time of the bridge: while both switches are off, the current picks the voltage.

A bridge that switches with frequency f and dead time t_d loses ``V_supply t_d f`` against the
current; near zero current, where the ripple takes it through zero in every period, the loss goes
through zero in proportion.  A three-phase bridge does so in each leg; seen from the rotor that is
a vector that turns on by 60 degrees with the sign of each phase: its sixth harmonic.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import clip, cos, law_function, sin, third_phase

ROOT_3 = 1.7320508075688772

CARD = Card(
    title='inverter dead time',
    equation='v = -v_d S(i / i_0)  (S: -1 to 1, straight through zero, flat beyond 1)',
    symptom='The unexplained voltage is constant against large currents and fades around zero '
    'current; a drop that is sharp at zero current is that of brushes.',
    reference='Jeong and Park, IEEE Trans. Ind. Electron. 38 (1991), The analysis and '
    'compensation of dead-time effects in PWM inverters',
    enters=Enters.INPUT,
    amplitudes=(Amplitude('v_d', 'V', 'voltage lost', Scale.VOLTAGE, positive=True),),
    shapes=(
        Shape('i_0', 'A', 'half the ripple of the current', Scale.CURRENT, (0.25, 0.8), 0.02,
              10.0),
    ),
    axis='current',
    generalises={'brush_voltage_drop': (('v_d', 'v_b'),)},
)  # fmt: skip


@law_function
def sign_of(i: float, i_0: float) -> float:
    """Sign of a current that the ripple takes through zero below `i_0`."""
    return clip(i / i_0, -1.0, 1.0)


def voltage(i: float, v_d: float, i_0: float) -> float:
    """Voltage in V."""
    return -v_d * sign_of(i, i_0)


def voltage_d(
    i_d: float, i_q: float, theta: float, pole_pairs: float, angle_offset: float, v_d: float,
    i_0: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    angle = pole_pairs * theta + angle_offset
    c, s = cos(angle), sin(angle)
    i_a, across = i_d * c - i_q * s, ROOT_3 * (i_d * s + i_q * c)
    s_a = sign_of(i_a, i_0)
    s_b, s_c = sign_of(0.5 * (across - i_a), i_0), sign_of(-0.5 * (across + i_a), i_0)
    return -v_d * ((2.0 * s_a - s_b - s_c) * c + ROOT_3 * (s_b - s_c) * s) / 3.0


def voltage_q(
    i_d: float, i_q: float, theta: float, pole_pairs: float, angle_offset: float, v_d: float,
    i_0: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    angle = pole_pairs * theta + angle_offset
    c, s = cos(angle), sin(angle)
    i_a, across = i_d * c - i_q * s, ROOT_3 * (i_d * s + i_q * c)
    s_a = sign_of(i_a, i_0)
    s_b, s_c = sign_of(0.5 * (across - i_a), i_0), sign_of(-0.5 * (across + i_a), i_0)
    return v_d * ((2.0 * s_a - s_b - s_c) * s - ROOT_3 * (s_b - s_c) * c) / 3.0


def voltage_a(i_a: float, i_b: float, v_d: float, i_0: float) -> float:
    """Voltage in V."""
    others = sign_of(i_b, i_0) + sign_of(third_phase(i_a, i_b), i_0)
    return -v_d * (2.0 * sign_of(i_a, i_0) - others) / 3.0


def voltage_b(i_a: float, i_b: float, v_d: float, i_0: float) -> float:
    """Voltage in V."""
    others = sign_of(i_a, i_0) + sign_of(third_phase(i_a, i_b), i_0)
    return -v_d * (2.0 * sign_of(i_b, i_0) - others) / 3.0
