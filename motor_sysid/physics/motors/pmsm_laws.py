"""Laws of the permanent magnet synchronous motor that are no part of its linear core.

The axes of a record are those that the drive takes for d and q.  The magnet lies `frame_error`
ahead of that d axis (electrical rad): half a count of the encoder, or a zero that was set by eye.
Seen from the record's axes its flux and the axes of the inductances turn with it:

    flux_d = L_dd i_d + L_x i_q + psi_f cos(frame_error)
    flux_q = L_x i_d + L_qq i_q + psi_f sin(frame_error)
    [L_dd L_x; L_x L_qq] d/dt [i_d; i_q] = [u_d - R i_d + omega_e flux_q;
                                            u_q - R i_q - omega_e flux_d]
    tau = 1.5 pole_pairs (flux_d i_q - flux_q i_d)

The laws here are what that has beyond the linear core; that an effect's voltage in one axis moves
the current in the other, too, where the inductances are turned, is left out.
"""

from motor_sysid.physics.effect import Card, Enters
from motor_sysid.physics.laws import cos, law_function, sin

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


@law_function
def sine(angle: float) -> float:
    """Return the sine of a small angle in rad, within 2e-6 up to 0.5 rad."""
    z = angle * angle
    return angle * (1.0 - z / 6.0 * (1.0 - z / 20.0))


@law_function
def less_cosine(angle: float) -> float:
    """Return one minus the cosine of a small angle in rad, within 1e-7 up to 0.5 rad."""
    z = angle * angle
    return 0.5 * z * (1.0 - z / 12.0 * (1.0 - z / 30.0))


@law_function
def crossed(L_d: float, L_q: float, frame_error: float) -> float:
    """Return the inductance L_x from one recorded axis to the other, in H."""
    return (L_d - L_q) * sine(frame_error) * (1.0 - less_cosine(frame_error))


@law_function
def turned(L_d: float, L_q: float, frame_error: float) -> float:
    """Return what turning takes from the inductance on d and gives that on q, in H."""
    s = sine(frame_error)
    return (L_d - L_q) * s * s


@law_function
def forced_d(
    u_d: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, frame_error: float,
) -> float:  # fmt: skip
    """Return the rate of the flux on the recorded d axis, in V."""
    own, other = L_q + turned(L_d, L_q, frame_error), crossed(L_d, L_q, frame_error)
    flux = other * i_d + own * i_q + psi_f * sine(frame_error)
    return u_d - R * i_d + pole_pairs * omega * flux


@law_function
def forced_q(
    u_q: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, frame_error: float,
) -> float:  # fmt: skip
    """Return the rate of the flux on the recorded q axis, in V."""
    own, other = L_d - turned(L_d, L_q, frame_error), crossed(L_d, L_q, frame_error)
    flux = own * i_d + other * i_q + psi_f * (1.0 - less_cosine(frame_error))
    return u_q - R * i_q - pole_pairs * omega * flux


def voltage_d(
    u_d: float, u_q: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, frame_error: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    d = forced_d(u_d, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, frame_error)
    q = forced_q(u_q, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, frame_error)
    more = turned(L_d, L_q, frame_error) * d - crossed(L_d, L_q, frame_error) * q
    return d + more / L_q - (u_d - R * i_d)


def voltage_q(
    u_d: float, u_q: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, frame_error: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    d = forced_d(u_d, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, frame_error)
    q = forced_q(u_q, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, frame_error)
    less = turned(L_d, L_q, frame_error) * q + crossed(L_d, L_q, frame_error) * d
    return q - less / L_d - (u_q - R * i_q - pole_pairs * omega * psi_f)


def torque(
    i_d: float, i_q: float, L_d: float, L_q: float, psi_f: float, pole_pairs: float,
    frame_error: float,
) -> float:  # fmt: skip
    """Torque in N m."""
    lost = sine(frame_error) * i_d + less_cosine(frame_error) * i_q
    pulled = (L_d - L_q - 2.0 * turned(L_d, L_q, frame_error)) * i_d * i_q
    leaning = crossed(L_d, L_q, frame_error) * (i_q * i_q - i_d * i_d)
    return 1.5 * pole_pairs * (pulled + leaning - psi_f * lost)


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
