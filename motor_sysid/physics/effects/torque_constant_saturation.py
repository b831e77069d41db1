"""Saturated iron: the torque constant, and the back-EMF constant with it, falls with current.

The fall begins as a parabola and goes on as a straight line; the knee lies where iron begins to
saturate, and near zero where a permanent bias lets it fall from the start.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import law_function, sqrt

CARD = Card(
    title='torque constant saturation',
    equation='k = k_t (1 - s (sqrt(i^2 + i_k^2) - i_k))',
    symptom='High currents give less torque than they should, and less back-EMF.',
    reference='Krishnan, Electric Motor Drives, 2001, section 2.4',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('s', '1/A', 'fall of the constant per ampere beyond the knee',
                  Scale.PER_CURRENT, 1.0, positive=True),
    ),
    shapes=(
        Shape('i_k', 'A', 'current of the knee', Scale.CURRENT, (0.1, 1.0), 0.02, 10.0),
    ),
    axis='current',
    hidden_by=('no_current',),
)  # fmt: skip


@law_function
def beyond(i: float, i_k: float) -> float:
    """Return how far a current is beyond the knee, in A."""
    return sqrt(i * i + i_k * i_k) - i_k


def torque(i: float, k_t: float, s: float, i_k: float) -> float:
    """Torque in N m."""
    return -s * k_t * i * beyond(i, i_k)


def voltage(i: float, omega: float, k_t: float, emf_ratio: float, s: float, i_k: float) -> float:
    """Voltage in V."""
    return s * emf_ratio * k_t * omega * beyond(i, i_k)


def torque_dq(i_q: float, psi_f: float, pole_pairs: float, s: float, i_k: float) -> float:
    """Torque in N m."""
    return -1.5 * s * pole_pairs * psi_f * i_q * beyond(i_q, i_k)


def voltage_q(
    i_q: float, omega: float, psi_f: float, pole_pairs: float, s: float, i_k: float
) -> float:
    """Voltage in V."""
    return s * pole_pairs * psi_f * omega * beyond(i_q, i_k)
