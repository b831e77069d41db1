"""A torque constant that depends on the rotor angle: slots, commutator bars, uneven magnets.

By power balance the back-EMF constant has the same ripple.  Unlike cogging it needs current.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import cos, sin, step_share

CARD = Card(
    title='torque ripple',
    equation='k = k_t (1 + a cos(n theta) + b sin(n theta))',
    symptom='The unexplained torque is a wave over one turn that grows with the current and '
    'changes its sign with it.',
    reference='Jahns and Soong, IEEE Trans. Ind. Electron. 43 (1996), Pulsating torque '
    'minimization techniques for permanent magnet AC motor drives: a review',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('a', '1', 'cosine of the relative ripple', Scale.ONE, 0.9),
        Amplitude('b', '1', 'sine of the relative ripple', Scale.ONE, 0.9),
    ),
    shapes=(
        Shape('n', '1/rev', 'waves per turn', Scale.ONE, (), 1.0, 400.0, free=False),
    ),
    axis='position',
    rotary=True,
    orders='n',
    carrier='i',
    hidden_by=('short_travel',),
)  # fmt: skip


def torque(
    i: float, theta: float, turn: float, k_t: float, a: float, b: float, n: float
) -> float:
    """Torque in N m."""
    return k_t * i * (a * cos(n * theta) + b * sin(n * theta)) * step_share(n * turn)


def voltage(
    omega: float, theta: float, turn: float, k_t: float, emf_ratio: float,
    a: float, b: float, n: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    wave = (a * cos(n * theta) + b * sin(n * theta)) * step_share(n * turn)
    return -emf_ratio * k_t * omega * wave


def torque_dq(
    i_q: float, theta: float, turn: float, psi_f: float, pole_pairs: float, a: float, b: float,
    n: float,
) -> float:  # fmt: skip
    """Torque in N m."""
    wave = (a * cos(n * theta) + b * sin(n * theta)) * step_share(n * turn)
    return 1.5 * pole_pairs * psi_f * i_q * wave


def voltage_q(
    omega: float, theta: float, turn: float, psi_f: float, pole_pairs: float, a: float, b: float,
    n: float,
) -> float:  # fmt: skip
    """Voltage in V."""
    wave = (a * cos(n * theta) + b * sin(n * theta)) * step_share(n * turn)
    return -pole_pairs * psi_f * omega * wave
