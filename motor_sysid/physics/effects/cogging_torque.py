"""Cogging: magnets that prefer the slots, several waves per turn.

The waves of an ideal machine are as many as the least common multiple of slots and poles.  Magnets
that are not alike add waves as many as the slots, slots that are not alike as many as the poles;
so a real one has several sets of waves.  (Gasparin et al., IEEE Trans. Magn. 45 (2009) 1210.)
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import cos, sin, step_share

CARD = Card(
    title='cogging torque',
    equation='tau = sum over h = 1, 2 of a_h cos(h n theta) + b_h sin(h n theta)',
    symptom='The unexplained torque is a wave over one turn with several periods; '
    'slow motion is uneven.',
    reference='Zhu and Howe, IEEE Trans. Energy Convers. 15 (2000), doi:10.1109/60.900501',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('a_1', 'N m', 'cosine of the fundamental', Scale.TORQUE),
        Amplitude('b_1', 'N m', 'sine of the fundamental', Scale.TORQUE),
        Amplitude('a_2', 'N m', 'cosine of the second harmonic', Scale.TORQUE),
        Amplitude('b_2', 'N m', 'sine of the second harmonic', Scale.TORQUE),
    ),
    shapes=(
        Shape('n', '1/rev', 'waves per turn', Scale.ONE, (), 2.0, 400.0, free=False),
    ),
    axis='position',
    rotary=True,
    orders='n',
    repeats=3,
    hidden_by=('short_travel',),
)


def torque(
    theta: float, turn: float, a_1: float, b_1: float, a_2: float, b_2: float, n: float
) -> float:
    """Torque in N m."""
    angle = n * theta
    c, s = cos(angle), sin(angle)
    second = a_2 * (1.0 - 2.0 * s * s) + b_2 * 2.0 * s * c
    return (a_1 * c + b_1 * s) * step_share(n * turn) + second * step_share(2.0 * n * turn)
