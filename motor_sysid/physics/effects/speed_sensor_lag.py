"""The speed is shown late: a tachometer's filter, or the low pass of a drive's estimate.

A drive may filter sample by sample: then `motor_sysid.physics.readings` stands for the law.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='speed sensor lag',
    equation='omega_shown = omega_f,  lag domega_f/dt = omega - omega_f',
    symptom='The speed answers later than the current tells, and its corners are round; the '
    'inertia seems too large at once after a step and right later.',
    reference='Ellis, Control System Design Guide, 4th ed. 2012, chapter 14',
    enters=Enters.SENSOR,
    amplitudes=(
        Amplitude('lag', 's', 'time constant of the filter', Scale.SAMPLE, 200.0, positive=True,
                  trials=(0.7, 3.0, 12.0)),
    ),
    axis='time',
    states=('omega_f',),
    begins={'omega_f': 'omega'},
    filter='lag',
    linear=True,
)  # fmt: skip


def speed_sensor(omega: float, omega_f: float, lag: float) -> float:
    """Return what is added to the reading, in rad/s."""
    return (omega_f - omega) * lag / (lag + 1e-7)


def speed_sum(shown: float, lag: float) -> float:
    """Return what the sum of the shown speed has beyond the angle, in rad."""
    return -lag * shown


def rate(omega: float, omega_f: float, lag: float) -> float:
    """Rate of the filtered speed in rad/s^2."""
    return (omega - omega_f) / (lag + 1e-7)
