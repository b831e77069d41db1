"""An unbalanced mass on the shaft: torque that goes round once per turn."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale
from motor_sysid.physics.laws import cos, sin

REACH = 100.0
"""Times the torque in use: of an arm that swings by a few degrees a small part acts."""

CARD = Card(
    title='gravity load',
    equation='tau = -tau_sin sin(theta) - tau_cos cos(theta)',
    symptom='The unexplained torque goes up and down once per turn.',
    reference='Siciliano et al., Robotics, 2009, section 7.2',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude(
            'tau_sin', 'N m', 'torque a quarter turn from zero position', Scale.TORQUE, REACH,
            swings=True,
        ),
        Amplitude('tau_cos', 'N m', 'torque at zero position', Scale.TORQUE, REACH, swings=True),
    ),
    axis='position',
    rotary=True,
)  # fmt: skip


def torque(theta: float, tau_sin: float, tau_cos: float) -> float:
    """Torque in N m."""
    return -tau_sin * sin(theta) - tau_cos * cos(theta)
