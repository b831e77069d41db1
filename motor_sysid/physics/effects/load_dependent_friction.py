"""Gear friction: it grows with the torque that the gear transmits."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale
from motor_sysid.physics.laws import smooth_sign

CARD = Card(
    title='load-dependent friction',
    equation='tau = -mu |k_t i| sign(omega)',
    symptom='Friction is higher when the motor drives hard than when it coasts at the same speed.',
    reference='Duclusaud et al., ICRA 2025, Extended Friction Models for Servo Actuators',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('mu', '1', 'friction per transmitted torque', Scale.ONE, 0.95, positive=True),
    ),
    axis='current',
)


def torque(i: float, omega: float, omega_eps: float, k_t: float, mu: float) -> float:
    """Torque in N m."""
    return -mu * k_t * abs(i) * smooth_sign(omega, omega_eps)
