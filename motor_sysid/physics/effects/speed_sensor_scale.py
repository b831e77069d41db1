"""The speed sensor shows more or less than there is, in proportion.

Voltage, current and speed alone cannot show it: a motor whose constant, inertia and friction are
larger or smaller by the right factors reads the same.  It shows against what fixes a scale: a
known parameter, or torques that repeat with the measured angle.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='speed sensor scale',
    equation='omega_shown = (1 + g) omega',
    symptom='The shown speed and the change of the position do not fit together, or the motor '
    'constant comes out other than the data sheet says.',
    reference='Krishnan, Electric Motor Drives, 2001, section 2.3',
    enters=Enters.SENSOR,
    amplitudes=(Amplitude('g', '1', 'error of the gain', Scale.ONE, 0.9),),
)


def speed_sensor(omega: float, g: float) -> float:
    """Return what is added to the reading, in rad/s."""
    return g * omega


def speed_sum(summed: float, g: float) -> float:
    """Return what the sum of the shown speed has beyond the angle, in rad."""
    return summed * g / (1.0 + g)
