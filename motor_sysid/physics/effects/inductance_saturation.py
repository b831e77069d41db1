"""Saturated iron: the inductance falls with current.

``L`` is the inductance of the saturated iron; without current it is ``(1 + s) L``.  It is the
slope of the flux linkage, so that no further term comes in.  In a motor with a d and a q axis each
axis saturates with its own current, and the flux of one, ``L (i + s i_s atan(i / i_s))``, makes
voltage in the other and torque.  In a motor told by phases the amplitude of the current counts.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import amplitude, atan, bell, law_function

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
    shrinks=('L', 'L_d', 'L_q'),
    hidden_by=('no_current', 'slow_sampling'),
)  # fmt: skip


def voltage(i: float, di: float, L: float, s: float, i_s: float) -> float:
    """Voltage in V."""
    return -L * s * bell(i, i_s) * di


def voltage_d(i_d: float, di_d: float, L_d: float, s: float, i_s: float) -> float:
    """Voltage in V."""
    return -L_d * s * bell(i_d, i_s) * di_d


def voltage_q(i_q: float, di_q: float, L_q: float, s: float, i_s: float) -> float:
    """Voltage in V."""
    return -L_q * s * bell(i_q, i_s) * di_q


@law_function
def excess(i: float, s: float, i_s: float) -> float:
    """Flux linkage beyond that of the saturated iron, over the inductance of that, in A."""
    return s * i_s * atan(i / i_s)


def and_voltage_d(
    i_q: float, omega: float, pole_pairs: float, L_q: float, s: float, i_s: float
) -> float:
    """Voltage in V."""
    return pole_pairs * omega * L_q * excess(i_q, s, i_s)


def and_voltage_q(
    i_d: float, omega: float, pole_pairs: float, L_d: float, s: float, i_s: float
) -> float:
    """Voltage in V."""
    return -pole_pairs * omega * L_d * excess(i_d, s, i_s)


def torque_dq(
    i_d: float, i_q: float, pole_pairs: float, L_d: float, L_q: float, s: float, i_s: float
) -> float:
    """Torque in N m."""
    pull = L_d * excess(i_d, s, i_s) * i_q - L_q * excess(i_q, s, i_s) * i_d
    return 1.5 * pole_pairs * pull


def voltage_a(
    i_a: float, i_b: float, di_a: float, L: float, s: float, i_s: float
) -> float:
    """Voltage in V."""
    return -L * s * bell(amplitude(i_a, i_b), i_s) * di_a


def voltage_b(
    i_a: float, i_b: float, di_b: float, L: float, s: float, i_s: float
) -> float:
    """Voltage in V."""
    return -L * s * bell(amplitude(i_a, i_b), i_s) * di_b
