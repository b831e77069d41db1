"""The current sensor shows a current where there is none.

A motor with a measured current has this offset among its own parameters (``current_offset``), free
in every fit, so that it is never mistaken for missing physics and never diagnosed: the fitted
value is the answer.  The effect is offered only where that parameter is held.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='current sensor offset',
    equation='i_shown = i + o',
    symptom='Forward and backward runs at the same voltage differ in current, but not in speed.',
    reference='Krishnan, Electric Motor Drives, 2001, section 2.3',
    enters=Enters.SENSOR,
    amplitudes=(
        Amplitude('o', 'A', 'current that is shown at rest', Scale.CURRENT, 1.0),
    ),
    axis='current',
    covers='current_offset',
    hidden_by=('one_direction',),
)  # fmt: skip


def current_sensor(o: float) -> float:
    """Return what is added to the reading, in A."""
    return o
