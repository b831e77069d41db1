"""LuGre friction: bristles that bend before they slip, so friction has a memory.

``z`` is the bend of the bristles.  Sliding steadily the torque is that of Stribeck friction; a
short way after a reversal it is a spring.  The bristle damping fades with speed, which keeps the
law passive (Olsson et al., Eur. J. Control 4, 1998, section 5).
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import bell

CARD = Card(
    title='LuGre friction',
    equation='tau = -tau_c/z_s (z + t_b B dz/dt),  dz/dt = omega - |omega| z / (z_s g(omega)),  '
    'g = 1 + s / (1 + (omega/omega_s)^2)',
    symptom='Friction sets in gradually after every reversal and the axis springs back a little '
    'when the torque is taken off; fast and slow passages through one speed differ.',
    reference='Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE Trans. Autom. Control 40 (1995), '
    'doi:10.1109/9.376053',
    enters=Enters.MECHANICAL,
    amplitudes=(Amplitude('tau_c', 'N m', 'Coulomb torque', Scale.TORQUE, positive=True),),
    shapes=(
        Shape('s', '1', 'rise at low speed over Coulomb torque', Scale.ONE, (0.2,), 1e-3, 5.0),
        Shape('omega_s', 'rad/s', 'speed at which half of the rise is gone', Scale.SPEED, (0.1,),
              0.005, 1.5),
        Shape('z_s', 'rad', 'bend at which the bristles slip', Scale.ANGLE,
              (0.05, 0.3, 1.5), 2e-3, 50.0),
        Shape('t_b', 's', 'bristle damping over bristle stiffness', Scale.SAMPLE, (1.0,),
              0.05, 50.0, free=False),
    ),
    states=('z',),
    generalises={
        'coulomb_friction': (('tau_c', 'tau_c'),),
        'stribeck_friction': (('tau_c', 'tau_c'),),
    },
    misfit=0.05,
    hidden_by=('never_slow',),
)  # fmt: skip


def torque(
    omega: float, z: float, tau_c: float, s: float, omega_s: float, z_s: float, t_b: float
) -> float:
    """Torque in N m."""
    slip = omega - abs(omega) * z / (z_s * (1.0 + s * bell(omega, omega_s)))
    return -tau_c / z_s * (z + t_b * bell(omega * t_b, z_s) * slip)


def rate(omega: float, z: float, s: float, omega_s: float, z_s: float) -> float:
    """Rate of the bend in rad/s."""
    return omega - abs(omega) * z / (z_s * (1.0 + s * bell(omega, omega_s)))
