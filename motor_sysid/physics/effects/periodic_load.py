"""A load that swings with a frequency of its own: a pump, a crank, a vibrating neighbour.

Its phase counts from the start of the record, so that records of their own are explained only
where each begins at the same phase; hold back a part of one record to validate.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import cos, sin, TWO_PI

CARD = Card(
    title='periodic load',
    equation='tau = a cos(2 pi f t) + b sin(2 pi f t)  (t: time since the start of the record)',
    symptom='The unexplained torque swings at one frequency, whatever the motor does.',
    reference='Bodson and Douglas, Automatica 33 (1997), Adaptive algorithms for the rejection of '
    'sinusoidal disturbances with unknown frequency',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('a', 'N m', 'cosine of the load', Scale.TORQUE),
        Amplitude('b', 'N m', 'sine of the load', Scale.TORQUE),
    ),
    shapes=(Shape('f', 'Hz', 'frequency', Scale.RATE, (), 1e-6, 0.4),),
    axis='time',
    frequency='f',
    repeats=3,
)


def torque(t: float, a: float, b: float, f: float) -> float:
    """Torque in N m."""
    angle = TWO_PI * f * t
    return a * cos(angle) + b * sin(angle)
