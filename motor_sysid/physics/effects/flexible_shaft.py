"""A load behind a springy shaft or belt: two masses instead of one.

Motor side ``J domega/dt = ... - T_s``, load side ``J_l domega_l/dt = T_s`` with the shaft torque
``T_s = J_l (w_a^2 phi + 2 z w_a (omega - omega_l))`` and ``dphi/dt = omega - omega_l``; ``w_a`` is
the antiresonance, at which the load holds the motor still.  With the effect, ``J`` is the motor
side alone.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import law_function

CARD = Card(
    title='flexible shaft',
    equation='tau = -r J (w_a^2 phi + 2 z w_a dphi/dt),  dphi/dt = omega - omega_l',
    symptom='After every step of torque the speed swings at one frequency; '
    'the inertia seems to depend on how fast the input changes.',
    reference='Ellis, Control System Design Guide, 4th ed. 2012, chapter 16',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('r', '1', 'inertia of the load over that of the motor', Scale.ONE, 20.0,
                  positive=True),
    ),
    shapes=(
        Shape(
            'w_a', 'rad/s', 'antiresonance', Scale.RATE,
            (0.015, 0.025, 0.04, 0.065, 0.1, 0.16, 0.26, 0.4, 0.65, 1.0, 1.6), 0.003, 4.0,
        ),
        Shape('z', '1', 'damping ratio of the shaft', Scale.ONE, (0.05,), 1e-4, 2.0),
    ),
    axis='time',
    states=('phi', 'omega_l'),
    begins={'omega_l': 'omega'},
    shrinks=('J', 'k_a'),
    linear=True,
    grids=(
        {
            'r': (0.3, 1.0, 3.0),
            'w_a': (0.015, 0.022, 0.033, 0.05, 0.075, 0.11, 0.16, 0.24, 0.36, 0.55, 0.8, 1.2, 1.8),
            'z': (0.05, 0.3),
        },
    ),
)  # fmt: skip


@law_function
def pull(omega: float, phi: float, omega_l: float, w_a: float, z: float) -> float:
    """Acceleration of the load by the shaft in rad/s^2."""
    return w_a * w_a * phi + 2.0 * z * w_a * (omega - omega_l)


def torque(
    omega: float, J: float, phi: float, omega_l: float, r: float, w_a: float, z: float
) -> float:
    """Torque in N m."""
    return -r * J * pull(omega, phi, omega_l, w_a, z)


def voltage_reduced(
    omega: float, k_a: float, phi: float, omega_l: float, r: float, w_a: float, z: float
) -> float:
    """Voltage in V."""
    return -r * k_a * pull(omega, phi, omega_l, w_a, z)


def rate_phi(omega: float, omega_l: float) -> float:
    """Rate of the twist in rad/s."""
    return omega - omega_l


def rate_omega_l(omega: float, phi: float, omega_l: float, w_a: float, z: float) -> float:
    """Acceleration of the load in rad/s^2."""
    return pull(omega, phi, omega_l, w_a, z)
