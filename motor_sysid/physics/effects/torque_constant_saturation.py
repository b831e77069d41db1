"""Saturated iron: the torque constant, and the back-EMF constant with it, falls with current."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='torque constant saturation',
    equation='k = k_t (1 - s |i|)',
    symptom='High currents give less torque than they should, and less back-EMF.',
    reference='Krishnan, Electric Motor Drives, 2001, section 2.4',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('s', '1/A', 'fall of the constant per ampere', Scale.PER_CURRENT, 1.0,
                  positive=True),
    ),
    axis='current',
    hidden_by=('no_current',),
)  # fmt: skip


def torque(i: float, k_t: float, s: float) -> float:
    """Torque in N m."""
    return -s * k_t * i * abs(i)


def voltage(i: float, omega: float, k_t: float, emf_ratio: float, s: float) -> float:
    """Voltage in V."""
    return s * emf_ratio * k_t * omega * abs(i)


def torque_dq(i_q: float, psi_f: float, pole_pairs: float, s: float) -> float:
    """Torque in N m."""
    return -1.5 * s * pole_pairs * psi_f * i_q * abs(i_q)


def voltage_q(i_q: float, omega: float, psi_f: float, pole_pairs: float, s: float) -> float:
    """Voltage in V."""
    return s * pole_pairs * psi_f * omega * abs(i_q)
