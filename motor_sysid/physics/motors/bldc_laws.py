"""Laws of the brushless motor with a trapezoidal back-EMF that are no part of its linear core.

With ``s = pole_pairs theta + angle_offset`` the back-EMF of phase a is ``-k_e omega f(s)``, where
the trapezoid f is zero and rising at 0, like a sine; b and c follow by a third of a turn.  The
star point floats: it takes the mean of the three.
"""

from motor_sysid.physics.effect import Card, Enters
from motor_sysid.physics.laws import law_function, THIRD, trapezoid

CARD = Card(
    title='trapezoidal back-EMF',
    equation='v_x = k_e omega (f_x - mean of f),  tau = -k_e (f_a i_a + f_b i_b + f_c i_c)',
    symptom='At constant speed the voltage between two phases is flat for a sixth of a turn.',
    reference='Krishnan, Electric Motor Drives, 2001, section 9.8',
    enters=Enters.ELECTRICAL,
    amplitudes=(),
)


@law_function
def voltage_a(
    omega: float, theta: float, k_e: float, pole_pairs: float, angle_offset: float, flat: float
) -> float:
    """Voltage in V."""
    s = pole_pairs * theta + angle_offset
    b, c = trapezoid(s - THIRD, flat), trapezoid(s + THIRD, flat)
    return k_e * omega * (2.0 * trapezoid(s, flat) - b - c) / 3.0


@law_function
def voltage_b(
    omega: float, theta: float, k_e: float, pole_pairs: float, angle_offset: float, flat: float
) -> float:
    """Voltage in V."""
    s = pole_pairs * theta + angle_offset
    a, c = trapezoid(s, flat), trapezoid(s + THIRD, flat)
    return k_e * omega * (2.0 * trapezoid(s - THIRD, flat) - a - c) / 3.0


@law_function
def torque(
    i_a: float, i_b: float, theta: float, k_e: float, pole_pairs: float, angle_offset: float,
    flat: float,
) -> float:  # fmt: skip
    """Torque in N m."""
    s = pole_pairs * theta + angle_offset
    a, b, c = trapezoid(s, flat), trapezoid(s - THIRD, flat), trapezoid(s + THIRD, flat)
    return -k_e * ((a - c) * i_a + (b - c) * i_b)


def drive_a(u_a: float, u_b: float, u_c: float) -> float:
    """Return the voltage of phase a against the star point without back-EMF, in V."""
    return (2.0 * u_a - u_b - u_c) / 3.0


def drive_b(u_a: float, u_b: float, u_c: float) -> float:
    """Return the voltage of phase b against the star point without back-EMF, in V."""
    return (2.0 * u_b - u_a - u_c) / 3.0


def emf_a(
    omega: float, theta: float, pole_pairs: float, angle_offset: float, flat: float
) -> float:
    """Return what k_e is multiplied by in the balance of phase a, in rad/s."""
    return -voltage_a(omega, theta, 1.0, pole_pairs, angle_offset, flat)


def emf_b(
    omega: float, theta: float, pole_pairs: float, angle_offset: float, flat: float
) -> float:
    """Return what k_e is multiplied by in the balance of phase b, in rad/s."""
    return -voltage_b(omega, theta, 1.0, pole_pairs, angle_offset, flat)


def lift(
    i_a: float, i_b: float, theta: float, pole_pairs: float, angle_offset: float, flat: float
) -> float:
    """Return what k_e is multiplied by in the torque balance, in A."""
    return torque(i_a, i_b, theta, 1.0, pole_pairs, angle_offset, flat)
