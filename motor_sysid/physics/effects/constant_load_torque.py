"""A constant torque on the shaft: a hanging weight on a drum, a preload, an offset."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='constant load torque',
    equation='tau = -tau_l',
    symptom='The unexplained torque has the same value at every speed, in both directions.',
    reference='Krishnan, Electric Motor Drives, 2001, section 1.6',
    enters=Enters.MECHANICAL,
    amplitudes=(Amplitude('tau_l', 'N m', 'load torque', Scale.TORQUE),),
    hidden_by=('one_direction',),
)


def torque(tau_l: float) -> float:
    """Torque in N m."""
    return -tau_l
