"""Laws of the permanent magnet synchronous motor that are no part of its linear core.

The axes of a record are those that the drive takes for d and q.  The magnet lies `frame_error`
ahead of that d axis (electrical rad): half a count of the encoder, or a zero that was set by eye;
see `motor_sysid.physics.rotor_frame`.  That an effect's voltage in one axis moves the current in
the other, too, where the inductances are turned, is left out.
"""

from motor_sysid.physics.effect import Card, Enters
from motor_sysid.physics.laws import cos, sin
from motor_sysid.physics.rotor_frame import more_on_d, more_on_q, more_torque

ROOT_THIRD = 0.5773502691896258

CARD = Card(
    title='coupling of both axes',
    equation='v_d = omega_e L_q i_q,  v_q = -omega_e L_d i_d,  '
    'tau = 1.5 pole_pairs (L_d - L_q) i_d i_q',
    symptom='At speed a current in one axis asks for a voltage in the other.',
    reference='Krishnan, Electric Motor Drives, 2001, chapter 9',
    enters=Enters.ELECTRICAL,
    amplitudes=(),
)


def voltage_d(
    u_d: float, u_q: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, frame_error: float, hold_squared: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    omega_e = pole_pairs * omega
    swept = omega_e * hold_squared * (omega_e * u_d / 24.0 + R * u_q / (12.0 * L_d))
    turned = more_on_d(u_d, u_q, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, frame_error)
    return turned + swept


def voltage_q(
    u_d: float, u_q: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, frame_error: float, hold_squared: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    omega_e = pole_pairs * omega
    swept = omega_e * hold_squared * (omega_e * u_q / 24.0 - R * u_d / (12.0 * L_q))
    turned = more_on_q(u_d, u_q, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, frame_error)
    return turned + swept


def torque(
    i_d: float, i_q: float, L_d: float, L_q: float, psi_f: float, pole_pairs: float,
    frame_error: float,
) -> float:  # fmt: skip
    """Torque in N m."""
    return more_torque(i_d, i_q, L_d, L_q, psi_f, pole_pairs, frame_error)


def current_d_sensor(
    theta: float, pole_pairs: float, angle_offset: float, current_offset_a: float,
    current_offset_b: float,
) -> float:  # fmt: skip
    """Return what the offsets of the phase sensors add to the d current, in A."""
    angle = pole_pairs * theta + angle_offset
    beta = (current_offset_a + 2.0 * current_offset_b) * ROOT_THIRD
    return current_offset_a * cos(angle) + beta * sin(angle)


def current_q_sensor(
    theta: float, pole_pairs: float, angle_offset: float, current_offset_a: float,
    current_offset_b: float,
) -> float:  # fmt: skip
    """Return what the offsets of the phase sensors add to the q current, in A."""
    angle = pole_pairs * theta + angle_offset
    beta = (current_offset_a + 2.0 * current_offset_b) * ROOT_THIRD
    return beta * cos(angle) - current_offset_a * sin(angle)


def emf_d(i_q: float, omega: float, pole_pairs: float) -> float:
    """Return what L_q is multiplied by in the d balance, in A/s."""
    return -pole_pairs * omega * i_q


def emf_q(i_d: float, omega: float, pole_pairs: float) -> float:
    """Return what L_d is multiplied by in the q balance, in A/s."""
    return pole_pairs * omega * i_d


def lift(i_q: float, pole_pairs: float) -> float:
    """Return what psi_f is multiplied by in the torque balance, in A."""
    return 1.5 * pole_pairs * i_q


def pull(i_d: float, i_q: float, pole_pairs: float) -> float:
    """Return what L_q - L_d is multiplied by in the torque balance, in A^2."""
    return 1.5 * pole_pairs * i_d * i_q
