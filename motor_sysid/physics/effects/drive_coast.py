"""A bridge that lets go between pulses: it drives the motor but does not brake it.

With drive/brake switching the motor is shorted between pulses and its mean voltage is duty times
supply.  With drive/coast switching the terminals float instead once the current has died away,
and show the back-EMF: the mean is ``u + (1 - |u|/u_c) e``, with ``u_c`` the supply voltage.  A
bridge that is off only in a band around zero command has a small ``u_c``.  Where no current is
measured, friction that cannot be told from back-EMF seems to let go, too.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import law_function

CARD = Card(
    title='drive/coast switching',
    equation='v = a k_e omega max(0, 1 - |u| / u_c)',
    symptom='At zero command the motor coasts without current instead of braking, and a small '
    'duty moves it almost as fast as a large one.',
    reference='Erickson and Maksimovic, Power Electronics, 3rd ed. 2020, chapter 5 (discontinuous '
    'conduction)',
    enters=Enters.INPUT,
    amplitudes=(
        Amplitude('a', '1', 'share of the pause in which the bridge lets go', Scale.ONE, 1.0,
                  positive=True),
    ),
    shapes=(
        Shape('u_c', 'V', 'command from which on nothing coasts', Scale.VOLTAGE, (0.3, 1.0, 2.5),
              0.02, 10.0, edge=True),
    ),
    axis='speed',
)  # fmt: skip


@law_function
def pause(u: float, u_c: float) -> float:
    """Share of the time in which the bridge lets go."""
    rest = 1.0 - abs(u) / u_c
    return 0.5 * (rest + abs(rest))


def voltage(
    omega: float, u: float, k_t: float, emf_ratio: float, a: float, u_c: float
) -> float:
    """Voltage in V."""
    return a * emf_ratio * k_t * omega * pause(u, u_c)


def voltage_reduced(omega: float, u: float, k_v: float, a: float, u_c: float) -> float:
    """Voltage in V."""
    return a * k_v * omega * pause(u, u_c)
