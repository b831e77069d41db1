"""Saturated iron: the inductance falls with current.

``L`` is the inductance of the saturated iron; without current it is ``(1 + s) L``.  It is the
slope of the flux linkage, so that no further term comes in.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import bell

CARD = Card(
    title='inductance saturation',
    equation='v = -L s / (1 + (i/i_s)^2) di/dt',
    symptom='Current rises faster from a high current than from zero.',
    reference='Fitzgerald et al., Electric Machinery, 6th ed. 2003, chapter 1',
    enters=Enters.ELECTRICAL,
    amplitudes=(
        Amplitude('s', '1', 'excess of the inductance without current', Scale.ONE, 5.0,
                  positive=True),
    ),
    shapes=(
        Shape('i_s', 'A', 'current at which half of the excess is gone', Scale.CURRENT, (0.5, 1.5),
              0.05, 10.0),
    ),
    axis='current',
    shrinks=('L',),
    hidden_by=('no_current', 'slow_sampling'),
)  # fmt: skip


def voltage(i: float, di: float, L: float, s: float, i_s: float) -> float:
    """Voltage in V."""
    return -L * s * bell(i, i_s) * di
