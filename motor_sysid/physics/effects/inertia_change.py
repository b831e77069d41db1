"""Another inertia from some time on: a load that is picked up, dropped or coupled in."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import law_function, smooth_step

CARD = Card(
    title='inertia change',
    equation='tau = -g J domega/dt from t = t_on on; for g < 0 the inertia falls to J / (1 - g)',
    symptom='From one moment on the same torque accelerates less (or more).',
    reference='Basseville and Nikiforov, Detection of Abrupt Changes, 1993, chapter 7',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('g', '1', 'inertia that comes on over inertia before; below zero: that goes '
                  'over inertia that stays', Scale.ONE, 10.0),
    ),
    shapes=(
        Shape('t_on', 's', 'when it changes', Scale.DURATION, (), 0.0, 1.0),
        Shape('rise', 's', 'half the time in which it changes', Scale.SAMPLE, (2.0,), 0.5, 1e4,
              free=False),
    ),
    axis='time',
    moment='t_on',
)  # fmt: skip


@law_function
def joined(t: float, g: float, t_on: float, rise: float) -> float:
    """Inertia that has come on, over the one before."""
    return g / (1.0 + 0.5 * (abs(g) - g)) * smooth_step(t - t_on, rise)


def torque(domega: float, t: float, J: float, g: float, t_on: float, rise: float) -> float:
    """Torque in N m."""
    return -J * joined(t, g, t_on, rise) * domega


def voltage_reduced(
    domega: float, t: float, k_a: float, g: float, t_on: float, rise: float
) -> float:
    """Voltage in V."""
    return -k_a * joined(t, g, t_on, rise) * domega
