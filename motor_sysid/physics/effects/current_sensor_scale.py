"""The current sensor shows more or less than there is, in proportion."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='current sensor scale',
    equation='i_shown = (1 + g) i',
    symptom='Copper loss, torque and back-EMF do not fit together: no resistance, inertia and '
    'constant explain current and speed at once.',
    reference='Krishnan, Electric Motor Drives, 2001, section 2.3',
    enters=Enters.SENSOR,
    amplitudes=(Amplitude('g', '1', 'error of the gain', Scale.ONE, 0.9),),
    axis='current',
)


def current_sensor(i: float, g: float) -> float:
    """Return what is added to the reading, in A."""
    return g * i


def current_d_sensor(i_d: float, g: float) -> float:
    """Return what is added to the reading, in A."""
    return g * i_d


def current_q_sensor(i_q: float, g: float) -> float:
    """Return what is added to the reading, in A."""
    return g * i_q


def current_a_sensor(i_a: float, g: float) -> float:
    """Return what is added to the reading, in A."""
    return g * i_a


def current_b_sensor(i_b: float, g: float) -> float:
    """Return what is added to the reading, in A."""
    return g * i_b
