"""Coulomb (dry) friction: a constant torque against the motion."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale
from motor_sysid.physics.laws import smooth_sign

CARD = Card(
    title='Coulomb friction',
    equation='tau = -tau_c sign(omega)',
    symptom='The unexplained torque is a step at zero speed; slow motion stops early.',
    reference='Olsson et al., Eur. J. Control 4 (1998), doi:10.1016/S0947-3580(98)70113-X',
    enters=Enters.MECHANICAL,
    amplitudes=(Amplitude('tau_c', 'N m', 'Coulomb torque', Scale.TORQUE, positive=True),),
    hidden_by=('constant_input', 'no_motion', 'one_direction', 'few_speeds'),
)


def torque(omega: float, omega_eps: float, tau_c: float) -> float:
    """Torque in N m."""
    return -tau_c * smooth_sign(omega, omega_eps)
