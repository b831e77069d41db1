"""Dead time of the bridge: while both switches are off, the current picks the voltage.

A bridge that switches with frequency f and dead time t_d loses ``V_supply t_d f`` against the
current; near zero current, where the ripple takes it through zero in every period, the loss goes
through zero in proportion.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import sqrt

ROUND = 2.5e-3
"""Square of the width of the corners, in units of the current at which they lie."""

CARD = Card(
    title='inverter dead time',
    equation='v = -v_d S(i / i_0)  (S: -1 to 1, straight through zero, flat beyond 1)',
    symptom='The unexplained voltage is constant against large currents and fades around zero '
    'current; a drop that is sharp at zero current is that of brushes.',
    reference='Jeong and Park, IEEE Trans. Ind. Electron. 38 (1991), The analysis and '
    'compensation of dead-time effects in PWM inverters',
    enters=Enters.INPUT,
    amplitudes=(Amplitude('v_d', 'V', 'voltage lost', Scale.VOLTAGE, positive=True),),
    shapes=(
        Shape('i_0', 'A', 'half the ripple of the current', Scale.CURRENT, (0.25, 0.8), 0.1, 3.0),
    ),
    axis='current',
    generalises={'brush_voltage_drop': (('v_d', 'v_b'),)},
)  # fmt: skip


def voltage(i: float, v_d: float, i_0: float) -> float:
    """Voltage in V."""
    x = i / i_0
    return -0.5 * v_d * (sqrt((x + 1.0) ** 2 + ROUND) - sqrt((x - 1.0) ** 2 + ROUND))
