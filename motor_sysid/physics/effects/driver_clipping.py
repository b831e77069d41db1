"""The drive cannot give the voltage that is asked of it."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='driver clipping',
    equation='v = clip(u, -1/c, 1/c) - u',
    symptom='Above some voltage nothing more happens: speed and current stay behind the model.',
    reference='Aastroem and Haegglund, Advanced PID Control, 2006, section 3.5',
    enters=Enters.INPUT,
    amplitudes=(
        Amplitude('c', '1/V', 'inverse of the highest voltage', Scale.PER_VOLTAGE, 3.0,
                  positive=True, trials=(0.5, 0.65, 0.8, 1.0, 1.3)),
    ),
    axis='time',
)  # fmt: skip


def voltage(u: float, c: float) -> float:
    """Voltage in V."""
    excess = c * abs(u) - 1.0
    over = 0.5 * (excess + abs(excess))
    return -u * over / (1.0 + over)
