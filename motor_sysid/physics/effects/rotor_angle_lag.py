"""The drive knows the rotor's angle late: its axes lie behind those of the magnet as it turns.

A filter of the encoder, its message on a bus and the time that a drive computes make the angle old
by a fraction of a millisecond, in which the rotor turns on: 7 electrical degrees in 100 us at
200 rad/s with six pole pairs.  Voltages and currents are recorded on those axes.  A drive that
turns its axes ahead by too much has a negative age.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale
from motor_sysid.physics.laws import clip, law_function
from motor_sysid.physics.rotor_frame import more_on_d, more_on_q, more_torque

CARD = Card(
    title='rotor angle lag',
    equation='axes turned by frame_error + omega_e lag instead of frame_error',
    symptom='A d voltage grows with the square of the speed though no d current flows, and at '
    'speed an ampere makes less torque.',
    reference='Bae and Sul, IEEE Trans. Ind. Appl. 39 (2003), A compensation method for time '
    'delay of full-digital synchronous frame current regulator of PWM AC drives',
    enters=Enters.INPUT,
    amplitudes=(Amplitude('lag', 's', 'age of the angle', Scale.SAMPLE, 2.0),),
    rotary=True,
    hidden_by=('no_motion', 'mostly_at_rest'),
)


@law_function
def late(omega: float, pole_pairs: float, frame_error: float, lag: float) -> float:
    """Angle of the magnet ahead of the axes, in rad."""
    return clip(frame_error + pole_pairs * omega * lag, -1.0, 1.0)


def voltage_d(
    u_d: float, u_q: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, frame_error: float, lag: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    angle = late(omega, pole_pairs, frame_error, lag)
    now = more_on_d(u_d, u_q, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, angle)
    then = more_on_d(u_d, u_q, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, frame_error)
    return now - then


def voltage_q(
    u_d: float, u_q: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, frame_error: float, lag: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    angle = late(omega, pole_pairs, frame_error, lag)
    now = more_on_q(u_d, u_q, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, angle)
    then = more_on_q(u_d, u_q, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, frame_error)
    return now - then


def torque_dq(
    i_d: float, i_q: float, omega: float, L_d: float, L_q: float, psi_f: float, pole_pairs: float,
    frame_error: float, lag: float,
) -> float:  # fmt: skip
    """Torque in N m."""
    angle = late(omega, pole_pairs, frame_error, lag)
    now = more_torque(i_d, i_q, L_d, L_q, psi_f, pole_pairs, angle)
    return now - more_torque(i_d, i_q, L_d, L_q, psi_f, pole_pairs, frame_error)
