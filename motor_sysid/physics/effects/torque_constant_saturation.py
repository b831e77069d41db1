"""Saturated iron: the torque constant, and the back-EMF constant with it, falls with current.

The fall begins as a parabola.  Far beyond the knee the saturated share is gone, and what is left
is constant: with a share of at most 1 torque never falls with current.  (To about 1 % of the
largest torque this fits tanh, arc tangent, Froelich's hyperbola and an exponential; a straight
line is off by up to a fifth where currents reach ten times the knee.)
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import law_function, sqrt

_MOST = 1.3
"""More than all: a fit to currents below a knee sharper than this law's asks for it."""

CARD = Card(
    title='torque constant saturation',
    equation='k = k_t (1 - a (1 - 1 / sqrt(1 + (i/i_k)^2)))',
    symptom='High currents give less torque than they should, and less back-EMF.',
    reference='Krishnan, Electric Motor Drives, 2001, section 2.4',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('a', '1', 'share of the torque constant that saturates', Scale.ONE, _MOST,
                  positive=True),
    ),
    shapes=(
        Shape('i_k', 'A', 'current of the knee', Scale.CURRENT, (0.3, 1.5), 0.02, 20.0),
    ),
    axis='current',
    hidden_by=('no_current',),
)  # fmt: skip


@law_function
def lost(i: float, i_k: float) -> float:
    """Return how much of the saturated share a current takes away, 0 to 1."""
    return 1.0 - 1.0 / sqrt(1.0 + i * i / (i_k * i_k))


def torque(i: float, k_t: float, a: float, i_k: float) -> float:
    """Torque in N m."""
    return -a * k_t * i * lost(i, i_k)


def voltage(i: float, omega: float, k_t: float, emf_ratio: float, a: float, i_k: float) -> float:
    """Voltage in V."""
    return a * emf_ratio * k_t * omega * lost(i, i_k)


def torque_dq(i_q: float, psi_f: float, pole_pairs: float, a: float, i_k: float) -> float:
    """Torque in N m."""
    return -1.5 * a * pole_pairs * psi_f * i_q * lost(i_q, i_k)


def voltage_q(
    i_q: float, omega: float, psi_f: float, pole_pairs: float, a: float, i_k: float
) -> float:
    """Voltage in V."""
    return a * pole_pairs * psi_f * omega * lost(i_q, i_k)
