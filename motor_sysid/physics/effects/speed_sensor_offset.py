"""The speed sensor shows a speed at standstill."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='speed sensor offset',
    equation='omega_shown = omega + o',
    symptom='Forward and backward runs at the same voltage differ in speed, but not in current.',
    reference='Ljung, System Identification, 2nd ed. 1999, section 14.1',
    enters=Enters.SENSOR,
    amplitudes=(Amplitude('o', 'rad/s', 'speed that is shown at standstill', Scale.SPEED, 1.0),),
    axis='speed',
    sum_of=('constant_load_torque',),
)


def speed_sensor(o: float) -> float:
    """Return what is added to the reading, in rad/s."""
    return o


def speed_sum(t: float, o: float) -> float:
    """Return what the sum of the shown speed has beyond the angle, in rad."""
    return o * t
