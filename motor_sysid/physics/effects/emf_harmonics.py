"""Magnets whose back-EMF is no pure wave: the fifth and seventh harmonic of a phase.

Seen from the rotor both are the sixth harmonic of the electrical angle, in the voltages of both
axes and, by power balance, in the torque of the current.  The third and its multiples are the same
in all phases and do nothing where the star point floats.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale
from motor_sysid.physics.laws import cos, law_function, sin, step_share, THIRD

CARD = Card(
    title='back-EMF harmonics',
    equation='e = -k_e omega (sin x + k_5 sin 5x + k_7 sin 7x),  x = pole_pairs theta',
    symptom='Voltages and torque have six waves per electrical turn that grow with the speed and '
    'with the current.',
    reference='Hanselman, Brushless Permanent Magnet Motor Design, 2nd ed. 2006, chapters 7 and 8',
    enters=Enters.ELECTRICAL,
    amplitudes=(
        Amplitude('k_5', '1', 'fifth harmonic over the fundamental', Scale.ONE, 0.5),
        Amplitude('k_7', '1', 'seventh harmonic over the fundamental', Scale.ONE, 0.5),
    ),
    axis='position',
    rotary=True,
)


@law_function
def on_d(x: float, k_5: float, k_7: float) -> float:
    """Waves on the axis of the magnet at its electrical angle in rad."""
    return (k_5 + k_7) * sin(6.0 * x)


@law_function
def on_q(x: float, k_5: float, k_7: float) -> float:
    """Waves across the magnet at its electrical angle in rad."""
    return (k_5 - k_7) * cos(6.0 * x)


def voltage_d(
    omega: float, theta: float, turn: float, psi_f: float, pole_pairs: float,
    angle_offset: float, frame_error: float, k_5: float, k_7: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    x = pole_pairs * theta + angle_offset + frame_error
    d, q = on_d(x, k_5, k_7), on_q(x, k_5, k_7)
    waves = d * cos(frame_error) - q * sin(frame_error)
    return pole_pairs * omega * psi_f * waves * step_share(6.0 * pole_pairs * turn)


def voltage_q(
    omega: float, theta: float, turn: float, psi_f: float, pole_pairs: float,
    angle_offset: float, frame_error: float, k_5: float, k_7: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    x = pole_pairs * theta + angle_offset + frame_error
    d, q = on_d(x, k_5, k_7), on_q(x, k_5, k_7)
    waves = d * sin(frame_error) + q * cos(frame_error)
    return pole_pairs * omega * psi_f * waves * step_share(6.0 * pole_pairs * turn)


def torque_dq(
    i_d: float, i_q: float, theta: float, turn: float, psi_f: float, pole_pairs: float,
    angle_offset: float, frame_error: float, k_5: float, k_7: float,
) -> float:  # fmt: skip
    """Torque in N m."""
    x = pole_pairs * theta + angle_offset + frame_error
    c, s = cos(frame_error), sin(frame_error)
    waves = on_q(x, k_5, k_7) * (c * i_q - s * i_d) + on_d(x, k_5, k_7) * (c * i_d + s * i_q)
    return -1.5 * pole_pairs * psi_f * waves * step_share(6.0 * pole_pairs * turn)


@law_function
def waves_of(x: float, k_5: float, k_7: float) -> float:
    """Both harmonics of a phase at its electrical angle in rad."""
    return k_5 * sin(5.0 * x) + k_7 * sin(7.0 * x)


def voltage_a(
    omega: float, theta: float, k_e: float, pole_pairs: float, angle_offset: float, k_5: float,
    k_7: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    return k_e * omega * waves_of(pole_pairs * theta + angle_offset, k_5, k_7)


def voltage_b(
    omega: float, theta: float, k_e: float, pole_pairs: float, angle_offset: float, k_5: float,
    k_7: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    return k_e * omega * waves_of(pole_pairs * theta + angle_offset - THIRD, k_5, k_7)


def torque_abc(
    i_a: float, i_b: float, theta: float, k_e: float, pole_pairs: float, angle_offset: float,
    k_5: float, k_7: float,
) -> float:  # fmt: skip
    """Torque in N m."""
    x = pole_pairs * theta + angle_offset
    c = waves_of(x + THIRD, k_5, k_7)
    a, b = waves_of(x, k_5, k_7) - c, waves_of(x - THIRD, k_5, k_7) - c
    return -k_e * (a * i_a + b * i_b)
