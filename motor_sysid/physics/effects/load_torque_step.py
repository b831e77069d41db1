"""A load that comes on at some time and stays: a part that is gripped, a brake, a tool in cut."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import smooth_step

CARD = Card(
    title='load torque step',
    equation='tau = -tau_l from t = t_on on  (t: time since the start of the record)',
    symptom='From one moment on the unexplained torque has another value, at every speed.',
    reference='Basseville and Nikiforov, Detection of Abrupt Changes, 1993, chapter 7',
    enters=Enters.MECHANICAL,
    amplitudes=(Amplitude('tau_l', 'N m', 'load torque that comes on', Scale.TORQUE),),
    shapes=(
        Shape('t_on', 's', 'when it comes on', Scale.DURATION, (), 0.0, 1.0),
        Shape('rise', 's', 'half the time in which it comes on', Scale.SAMPLE, (2.0,), 0.5, 1e4,
              free=False),
    ),
    axis='time',
    moment='t_on',
    generalises={'constant_load_torque': (('tau_l', 'tau_l'),)},
)  # fmt: skip


def torque(t: float, tau_l: float, t_on: float, rise: float) -> float:
    """Torque in N m."""
    return -tau_l * smooth_step(t - t_on, rise)
