"""Stribeck friction: dry friction that is higher near standstill."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import bell, smooth_sign

CARD = Card(
    title='Stribeck friction',
    equation='tau = -(tau_c + tau_s / (1 + (omega/omega_s)^2)) sign(omega)',
    symptom='Beside the step at zero speed, the unexplained torque has a peak at low speed; '
    'slow motion sticks and slips.',
    reference='Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994), '
    'doi:10.1016/0005-1098(94)90209-7',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('tau_c', 'N m', 'Coulomb torque', Scale.TORQUE, positive=True),
        Amplitude('tau_s', 'N m', 'rise above Coulomb at low speed', Scale.TORQUE, positive=True),
    ),
    shapes=(
        Shape(
            'omega_s', 'rad/s', 'speed at which half of the rise is gone', Scale.SPEED,
            (0.05, 0.15, 0.4), 0.005, 1.5,
        ),
    ),
    generalises={'coulomb_friction': (('tau_c', 'tau_c'),)},
    misfit=0.05,
    hidden_by=('constant_input', 'no_motion', 'few_speeds', 'never_slow'),
)  # fmt: skip


def torque(omega: float, omega_eps: float, tau_c: float, tau_s: float, omega_s: float) -> float:
    """Torque in N m."""
    return -(tau_c + tau_s * bell(omega, omega_s)) * smooth_sign(omega, omega_eps)
