"""Gear friction: it grows with the torque that the gear transmits.

Where the current is not measured, ``u - k_v omega`` stands for the motor's torque; an axis is
driven by its input.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale
from motor_sysid.physics.laws import smooth_sign, THIRD, trapezoid

CARD = Card(
    title='load-dependent friction',
    equation='tau = -mu |k_t i| sign(omega)',
    symptom='Friction is higher when the motor drives hard than when it coasts at the same speed.',
    reference='Duclusaud et al., ICRA 2025, Extended Friction Models for Servo Actuators',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('mu', '1', 'friction per transmitted torque', Scale.ONE, 0.95, positive=True),
    ),
    axis='current',
)


def torque(i: float, omega: float, omega_eps: float, k_t: float, mu: float) -> float:
    """Torque in N m."""
    return -mu * k_t * abs(i) * smooth_sign(omega, omega_eps)


def torque_dq(
    i_d: float, i_q: float, omega: float, omega_eps: float, psi_f: float, L_d: float, L_q: float,
    pole_pairs: float, mu: float,
) -> float:  # fmt: skip
    """Torque in N m."""
    driven = 1.5 * pole_pairs * (psi_f + (L_d - L_q) * i_d) * i_q
    return -mu * abs(driven) * smooth_sign(omega, omega_eps)


def torque_abc(
    i_a: float, i_b: float, theta: float, omega: float, omega_eps: float, k_e: float,
    pole_pairs: float, angle_offset: float, flat: float, corner: float, mu: float,
) -> float:  # fmt: skip
    """Torque in N m."""
    s = pole_pairs * theta + angle_offset
    a, b = trapezoid(s, flat, corner), trapezoid(s - THIRD, flat, corner)
    c = trapezoid(s + THIRD, flat, corner)
    driven = k_e * ((a - c) * i_a + (b - c) * i_b)
    return -mu * abs(driven) * smooth_sign(omega, omega_eps)


def voltage_reduced(omega: float, omega_eps: float, u: float, k_v: float, mu: float) -> float:
    """Voltage in V."""
    return -mu * abs(u - k_v * omega) * smooth_sign(omega, omega_eps)


def torque_driven(omega: float, omega_eps: float, u: float, gain: float, mu: float) -> float:
    """Torque in N m."""
    return -mu * gain * abs(u) * smooth_sign(omega, omega_eps)
