"""Drag that grows with the square of the speed: fans, propellers, churned oil."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='quadratic drag',
    equation='tau = -k_d omega |omega|',
    symptom='The unexplained torque is a pair of parabolas against speed; '
    'viscous friction seems to grow with speed.',
    reference='White, Fluid Mechanics, 2011, section 7.6',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('k_d', 'N m s^2/rad^2', 'drag coefficient', Scale.DRAG, positive=True),
    ),
    hidden_by=('no_motion', 'few_speeds'),
)


def torque(omega: float, k_d: float) -> float:
    """Torque in N m."""
    return -k_d * omega * abs(omega)
