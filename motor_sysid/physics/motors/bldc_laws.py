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
def above_star(s: float, flat: float, corner: float) -> float:
    """Return the wave of a phase at its electrical angle less the mean of all three."""
    b, c = trapezoid(s - THIRD, flat, corner), trapezoid(s + THIRD, flat, corner)
    return (2.0 * trapezoid(s, flat, corner) - b - c) / 3.0


@law_function
def pulled(i_a: float, i_b: float, s: float, flat: float, corner: float) -> float:
    """Return the sum of currents times waves, in A, at the electrical angle s in rad."""
    a, b = trapezoid(s, flat, corner), trapezoid(s - THIRD, flat, corner)
    c = trapezoid(s + THIRD, flat, corner)
    return (a - c) * i_a + (b - c) * i_b


def voltage_a(
    omega: float, theta: float, k_e: float, pole_pairs: float, angle_offset: float, flat: float,
    corner: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    return k_e * omega * above_star(pole_pairs * theta + angle_offset, flat, corner)


def voltage_b(
    omega: float, theta: float, k_e: float, pole_pairs: float, angle_offset: float, flat: float,
    corner: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    return k_e * omega * above_star(pole_pairs * theta + angle_offset - THIRD, flat, corner)


def torque(
    i_a: float, i_b: float, theta: float, k_e: float, pole_pairs: float, angle_offset: float,
    flat: float, corner: float,
) -> float:  # fmt: skip
    """Torque in N m."""
    return -k_e * pulled(i_a, i_b, pole_pairs * theta + angle_offset, flat, corner)


def drive_a(u_a: float, u_b: float, u_c: float) -> float:
    """Return the voltage of phase a against the star point without back-EMF, in V."""
    return (2.0 * u_a - u_b - u_c) / 3.0


def drive_b(u_a: float, u_b: float, u_c: float) -> float:
    """Return the voltage of phase b against the star point without back-EMF, in V."""
    return (2.0 * u_b - u_a - u_c) / 3.0


def emf_a(
    omega: float, theta: float, pole_pairs: float, angle_offset: float, flat: float,
    corner: float,
) -> float:  # fmt: skip
    """Return what k_e is multiplied by in the balance of phase a, in rad/s."""
    return -omega * above_star(pole_pairs * theta + angle_offset, flat, corner)


def emf_b(
    omega: float, theta: float, pole_pairs: float, angle_offset: float, flat: float,
    corner: float,
) -> float:  # fmt: skip
    """Return what k_e is multiplied by in the balance of phase b, in rad/s."""
    return -omega * above_star(pole_pairs * theta + angle_offset - THIRD, flat, corner)


def lift(
    i_a: float, i_b: float, theta: float, pole_pairs: float, angle_offset: float, flat: float,
    corner: float,
) -> float:  # fmt: skip
    """Return what k_e is multiplied by in the torque balance, in A."""
    return -pulled(i_a, i_b, pole_pairs * theta + angle_offset, flat, corner)
