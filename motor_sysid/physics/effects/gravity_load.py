"""An unbalanced mass on the shaft: torque that goes round once per turn."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale
from motor_sysid.physics.laws import cos, sin

CARD = Card(
    title='gravity load',
    equation='tau = -tau_sin sin(theta) - tau_cos cos(theta)',
    symptom='The unexplained torque goes up and down once per turn.',
    reference='Siciliano et al., Robotics, 2009, section 7.2',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude(
            'tau_sin', 'N m', 'torque a quarter turn from zero position', Scale.TORQUE, swings=True
        ),
        Amplitude('tau_cos', 'N m', 'torque at zero position', Scale.TORQUE, swings=True),
    ),
    axis='position',
    rotary=True,
)


def torque(theta: float, tau_sin: float, tau_cos: float) -> float:
    """Torque in N m."""
    return -tau_sin * sin(theta) - tau_cos * cos(theta)
