"""Iron losses: turning magnetizes the iron back and forth, with current or without.

Losses per time are of three kinds (Bertotti): hysteresis with the frequency, eddy currents with
its square, and excess losses with its power 1.5.  As torques the first is Coulomb friction and the
second viscous friction to any measurement of voltage, current and speed; the third, with the root
of the speed, is iron's own and is what this effect holds.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale
from motor_sysid.physics.laws import sqrt

CARD = Card(
    title='iron loss',
    equation='tau = -k_x sign(omega) |omega|^0.5',
    symptom='The unexplained torque against speed rises steeply at first and then ever more '
    'slowly; between dry and viscous friction.',
    reference='Bertotti, IEEE Trans. Magn. 24 (1988), General properties of power losses in soft '
    'ferromagnetic materials',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('k_x', 'N m s^0.5/rad^0.5', 'excess loss', Scale.ROOT_SPEED, positive=True),
    ),
)


def torque(omega: float, omega_eps: float, k_x: float) -> float:
    """Torque in N m."""
    return -k_x * omega / sqrt(sqrt(omega * omega + omega_eps * omega_eps))
