"""Coulomb friction that differs between the two directions."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale
from motor_sysid.physics.laws import smooth_sign

CARD = Card(
    title='asymmetric Coulomb friction',
    equation='tau = -tau_c_plus for omega > 0, +tau_c_minus for omega < 0',
    symptom='The unexplained torque is a step at zero speed whose two sides differ in height.',
    reference='Armstrong-Helouvry, Control of Machines with Friction, 1991, chapter 3',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('tau_c_plus', 'N m', 'friction turning forward', Scale.TORQUE, positive=True),
        Amplitude('tau_c_minus', 'N m', 'friction turning back', Scale.TORQUE, positive=True),
    ),
    generalises={'coulomb_friction': (('tau_c_plus', 'tau_c'), ('tau_c_minus', 'tau_c'))},
    sum_of=('coulomb_friction', 'constant_load_torque'),
    hidden_by=('constant_input', 'no_motion'),
)


def torque(omega: float, omega_eps: float, tau_c_plus: float, tau_c_minus: float) -> float:
    """Torque in N m."""
    s = smooth_sign(omega, omega_eps)
    return -0.5 * (tau_c_plus + tau_c_minus) * s - 0.5 * (tau_c_plus - tau_c_minus) * s * s
