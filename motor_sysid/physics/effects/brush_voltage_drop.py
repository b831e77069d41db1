"""Voltage lost at the brushes: nearly the same for any current.

Where the current is not measured: none flows until the drop is overcome.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale
from motor_sysid.physics.laws import clip, smooth_sign

CARD = Card(
    title='brush voltage drop',
    equation='v = -v_b sign(i)',
    symptom='The unexplained voltage is a step at zero current; resistance seems to fall as '
    'current grows.',
    reference='Fitzgerald et al., Electric Machinery, 6th ed. 2003, section 7.4',
    enters=Enters.ELECTRICAL,
    amplitudes=(Amplitude('v_b', 'V', 'drop of both brushes', Scale.VOLTAGE, positive=True),),
    axis='current',
    hidden_by=('no_current',),
)


def voltage_reduced(omega: float, u: float, k_v: float, v_b: float) -> float:
    """Voltage in V."""
    return -clip(u - k_v * omega, -v_b, v_b)


def voltage(i: float, i_eps: float, v_b: float) -> float:
    """Voltage in V."""
    return -v_b * smooth_sign(i, i_eps)
