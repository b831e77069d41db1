"""The drive puts its voltage where the rotor was: what it asks for on d and q acts too far back.

A drive measures angle and currents, computes, and applies its voltage from the next period on to
the one after: on average one and a half periods later.  Without a prediction of the angle the
voltage lies that far behind, 5 electrical degrees in 150 us at 150 rad/s with four pole pairs,
though the currents are told on the right axes.  One that predicts too much has a negative lag.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale
from motor_sysid.physics.laws import clip, law_function
from motor_sysid.physics.rotor_frame import less_cosine, sine

CARD = Card(
    title='voltage angle lag',
    equation='u_d, u_q turned back by omega_e lag',
    symptom='A d voltage grows with the speed and the q voltage though no d current flows, while '
    'an ampere makes as much torque as at rest.',
    reference='Bae and Sul, IEEE Trans. Ind. Appl. 39 (2003), A compensation method for time '
    'delay of full-digital synchronous frame current regulator of PWM AC drives',
    enters=Enters.INPUT,
    amplitudes=(
        Amplitude('lag', 's', 'how far the voltage is behind the rotor', Scale.SAMPLE, 4.0),
    ),
    rotary=True,
    hidden_by=('no_motion', 'mostly_at_rest'),
)


@law_function
def behind(omega: float, pole_pairs: float, lag: float) -> float:
    """Angle of the voltage behind the axes, in rad."""
    return clip(pole_pairs * omega * lag, -1.0, 1.0)


def voltage_d(u_d: float, u_q: float, omega: float, pole_pairs: float, lag: float) -> float:
    """Voltage in V."""
    angle = behind(omega, pole_pairs, lag)
    return u_q * sine(angle) - u_d * less_cosine(angle)


def voltage_q(u_d: float, u_q: float, omega: float, pole_pairs: float, lag: float) -> float:
    """Voltage in V."""
    angle = behind(omega, pole_pairs, lag)
    return -u_d * sine(angle) - u_q * less_cosine(angle)
