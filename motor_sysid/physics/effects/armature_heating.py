"""The winding warms by its own losses and its resistance rises with it."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape

CARD = Card(
    title='armature heating',
    equation='v = -R h q i,  dq/dt = R (1 + h q) i^2 - q / t_th  (q: stored loss energy)',
    symptom='The current at a given voltage and speed falls with time, faster after heavy load.',
    reference='Krishnan, Electric Motor Drives, 2001, section 2.10',
    enters=Enters.ELECTRICAL,
    amplitudes=(
        Amplitude(
            'h', '1/J', 'rise of resistance per stored energy', Scale.HEATING, positive=True
        ),
    ),
    shapes=(
        Shape(
            't_th', 's', 'thermal time constant', Scale.DURATION, (0.5, 0.1, 3.0), 0.01, 100.0,
        ),
    ),
    axis='time',
    states=('q',),
)  # fmt: skip


def voltage(i: float, R: float, q: float, h: float) -> float:
    """Voltage in V."""
    return -R * h * q * i


def rate(i: float, R: float, q: float, h: float, t_th: float) -> float:
    """Rate of the stored energy in W."""
    return R * (1.0 + h * q) * i * i - q / t_th


def voltage_d(i_d: float, R: float, q: float, h: float) -> float:
    """Voltage in V."""
    return -R * h * q * i_d


def voltage_q(i_q: float, R: float, q: float, h: float) -> float:
    """Voltage in V."""
    return -R * h * q * i_q


def rate_dq(i_d: float, i_q: float, R: float, q: float, h: float, t_th: float) -> float:
    """Rate of the stored energy in W."""
    return 1.5 * R * (1.0 + h * q) * (i_d * i_d + i_q * i_q) - q / t_th


def voltage_a(i_a: float, R: float, q: float, h: float) -> float:
    """Voltage in V."""
    return -R * h * q * i_a


def voltage_b(i_b: float, R: float, q: float, h: float) -> float:
    """Voltage in V."""
    return -R * h * q * i_b


def rate_abc(i_a: float, i_b: float, R: float, q: float, h: float, t_th: float) -> float:
    """Rate of the stored energy in W."""
    return 2.0 * R * (1.0 + h * q) * (i_a * i_a + i_a * i_b + i_b * i_b) - q / t_th
