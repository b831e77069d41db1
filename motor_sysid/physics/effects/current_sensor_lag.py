"""The current sensor shows the current late: its filter."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='current sensor lag',
    equation='i_shown = i_f,  lag di_f/dt = i - i_f',
    symptom='After every step of voltage the current rises later than the speed tells; the '
    'inductance seems too large, but only to the current.',
    reference='Astrom and Wittenmark, Computer-Controlled Systems, 3rd ed. 1997, section 7.4',
    enters=Enters.SENSOR,
    amplitudes=(
        Amplitude('lag', 's', 'time constant of the filter', Scale.SAMPLE, 200.0, positive=True,
                  trials=(0.7, 3.0, 12.0)),
    ),
    axis='time',
    states=('i_f',),
    begins={'i_f': 'i'},
    filter='lag',
    linear=True,
    hidden_by=('slow_sampling',),
)  # fmt: skip


def current_sensor(i: float, i_f: float, lag: float) -> float:
    """Return what is added to the reading, in A."""
    return (i_f - i) * lag / (lag + 1e-7)


def rate(i: float, i_f: float, lag: float) -> float:
    """Rate of the filtered current in A/s."""
    return (i - i_f) / (lag + 1e-7)
