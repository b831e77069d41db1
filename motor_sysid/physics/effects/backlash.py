"""Play in a gear before the load: the teeth let go at every reversal and strike again.

The flexible shaft with a gap: motor side ``J domega/dt = ... - T_s``, load side
``J_l domega_l/dt = T_s - J_l s_l omega_l`` with
``T_s = J_l (w_a^2 d + 2 z w_a c (omega - omega_l))``, where ``d`` is the part of the twist ``phi``
beyond the gap and ``c`` tells whether the teeth touch.  Teeth push and never pull: where damping
would hold them back, ``T_s`` is zero.  With the effect, ``J`` is the motor side alone, and ``b``
too where friction of the load is told from it: while the teeth are apart, each side is slowed by
its own.

``c`` rises from 0 to 1 over a thirtieth of the gap, half of it before the teeth meet: the blow is
then as strong as that of a step, but for what goes with the square of that width.

Of a play that passes soon the grid holds teeth that bounce, as of a flexible shaft; of a wide one
some that do not, so that when they strike next hardly depends on how stiff they are, and a fit
finds its way from a play that is off by a third.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import clip, law_function, sqrt

CARD = Card(
    title='backlash',
    equation='tau = -r J (w_a^2 d + 2 z w_a c dphi/dt),  dphi/dt = omega - omega_l,  '
    'd = phi beyond +-phi_g; teeth never pull, and s_l slows the load',
    symptom='At every reversal the motor runs free for a moment as if it had less inertia, then '
    'strikes the load.',
    reference='Nordin and Gutman, Automatica 38 (2002), Controlling mechanical systems with '
    'backlash: a survey',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('r', '1', 'inertia of the load over that of the motor', Scale.ONE, 20.0,
                  positive=True),
    ),
    shapes=(
        Shape('phi_g', 'rad', 'half of the play', Scale.ANGLE, (0.1, 0.4, 1.5), 5e-4, 50.0),
        Shape('w_a', 'rad/s', 'stiffness of the teeth: antiresonance in contact', Scale.RATE,
              (0.15, 0.5), 0.02, 4.0),
        Shape('z', '1', 'damping ratio of the teeth', Scale.ONE, (0.4,), 0.01, 2.0),
        Shape('s_l', '1/s', 'viscous friction of the load over its inertia', Scale.RATE, (0.0,),
              0.0, 0.2, free=False, bends=(3e-4,)),
    ),
    axis='time',
    states=('phi', 'omega_l'),
    begins={'omega_l': 'omega'},
    generalises={'flexible_shaft': (('r', 'r'), ('w_a', 'w_a'), ('z', 'z'))},
    shrinks=('J', 'k_a'),
    slows={'b': 's_l', 'k_v': 's_l'},
    pace='w_a',
    strikes=True,
    grids=(
        {
            'r': (0.3, 1.0, 3.0),
            'phi_g': (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0),
            'w_a': (0.25, 0.6, 1.5, 4.0),
            'z': (0.2,),
        },
        {
            'r': (0.4, 1.0, 2.5),
            'phi_g': (0.17, 0.37, 0.82, 1.8, 4.0, 8.7, 19.0, 42.0),
            'w_a': (0.5,),
            'z': (1.0,),
            's_l': (0.0, 0.4, 0.8),
        },
    ),
)  # fmt: skip


@law_function
def push(
    omega: float, phi: float, omega_l: float, phi_g: float, w_a: float, z: float
) -> float:
    """Acceleration of the load by the teeth in rad/s^2."""
    beyond = phi - clip(phi, -phi_g, phi_g)
    contact = clip(0.5 + 30.0 * (abs(phi) / phi_g - 1.0), 0.0, 1.0)
    acceleration = w_a * w_a * beyond + 2.0 * z * w_a * contact * (omega - omega_l)
    side = clip(1e30 * phi, -1.0, 1.0)
    return 0.5 * (acceleration + side * abs(acceleration))


def start_phi(omega: float, domega: float, phi_g: float, w_a: float, s_l: float) -> float:
    """Twist in rad where teeth touch and give a load that is in motion its acceleration.

    Less, down to none, where it would not have crossed the play yet had it begun at rest.
    """
    pushed = domega + s_l * omega
    crossed = clip(omega**2 / (4.0 * phi_g * abs(pushed) + 1e-300), 0.0, 1.0)
    return crossed * (clip(1e30 * pushed, -1.0, 1.0) * phi_g + pushed / w_a**2)


def doubt_omega(domega: float, r: float, phi_g: float) -> float:
    """Speed in rad/s by which a load that fell through the play moves both when it is caught."""
    return r / (1.0 + r) * sqrt(4.0 * phi_g * abs(domega))


def torque(
    omega: float, J: float, phi: float, omega_l: float, r: float, phi_g: float, w_a: float,
    z: float,
) -> float:  # fmt: skip
    """Torque in N m."""
    return -r * J * push(omega, phi, omega_l, phi_g, w_a, z)


def voltage_reduced(
    omega: float, k_a: float, phi: float, omega_l: float, r: float, phi_g: float, w_a: float,
    z: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    return -r * k_a * push(omega, phi, omega_l, phi_g, w_a, z)


def rate_phi(omega: float, omega_l: float) -> float:
    """Rate of the twist in rad/s."""
    return omega - omega_l


def rate_omega_l(
    omega: float, phi: float, omega_l: float, phi_g: float, w_a: float, z: float, s_l: float
) -> float:
    """Acceleration of the load in rad/s^2."""
    return push(omega, phi, omega_l, phi_g, w_a, z) - s_l * omega_l
