"""A torque over the position that was learned from data: what no effect explains."""

from motor_sysid.physics.effect import Card, Enters, Scale
from motor_sysid.physics.laws import cos, sin, step_share
from motor_sysid.physics.learned import waves

CARD = Card(
    title='learned torque over position',
    equation='tau = sum over n = 1 to 8 of a_n cos(n theta) + b_n sin(n theta)',
    symptom='The unexplained torque is a function of position of no shape that is known.',
    reference='Fourier series; Zygmund, Trigonometric Series, 2002',
    enters=Enters.MECHANICAL,
    amplitudes=waves('N m', Scale.TORQUE),
    axis='position',
    rotary=True,
)


def torque(
    theta: float, turn: float, a_1: float, a_2: float, a_3: float, a_4: float, a_5: float,
    a_6: float, a_7: float, a_8: float, b_1: float, b_2: float, b_3: float, b_4: float,
    b_5: float, b_6: float, b_7: float, b_8: float,
) -> float:  # fmt: skip
    """Torque in N m."""
    total = (a_1 * cos(theta) + b_1 * sin(theta)) * step_share(turn)
    total += (a_2 * cos(2.0 * theta) + b_2 * sin(2.0 * theta)) * step_share(2.0 * turn)
    total += (a_3 * cos(3.0 * theta) + b_3 * sin(3.0 * theta)) * step_share(3.0 * turn)
    total += (a_4 * cos(4.0 * theta) + b_4 * sin(4.0 * theta)) * step_share(4.0 * turn)
    total += (a_5 * cos(5.0 * theta) + b_5 * sin(5.0 * theta)) * step_share(5.0 * turn)
    total += (a_6 * cos(6.0 * theta) + b_6 * sin(6.0 * theta)) * step_share(6.0 * turn)
    total += (a_7 * cos(7.0 * theta) + b_7 * sin(7.0 * theta)) * step_share(7.0 * turn)
    total += (a_8 * cos(8.0 * theta) + b_8 * sin(8.0 * theta)) * step_share(8.0 * turn)
    return total
