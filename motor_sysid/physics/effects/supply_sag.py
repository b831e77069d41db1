"""A soft supply: its voltage falls as the bridge draws current.

The recorded voltage is duty times nominal supply ``V_0``; the bridge draws the duty times the
motor current, so the motor receives ``u - R_s (u / V_0)^2 i``.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='supply sag',
    equation='v = -a u^2 i,  a = R_s / V_0^2',
    symptom='Resistance seems larger at high voltage than at low voltage.',
    reference='Erickson and Maksimovic, Power Electronics, 3rd ed. 2020, chapter 3',
    enters=Enters.INPUT,
    amplitudes=(
        Amplitude('a', '1/(V A)', 'source resistance over supply voltage squared', Scale.SAG,
                  positive=True),
    ),
    axis='current',
)  # fmt: skip


def voltage(i: float, u: float, a: float) -> float:
    """Voltage in V."""
    return -a * u * u * i
