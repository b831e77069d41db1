"""Brushed DC motor with measured current: armature and rotor.

    L di/dt     = u - R i - k_e omega + voltage effects
    J domega/dt = k_t i - b omega + torque effects
    dtheta/dt   = omega

``k_e = emf_ratio k_t``; power balance makes the ratio 1 in SI units, and with it fixed every
parameter can be identified from voltage, current and speed.
(Krishnan, Electric Motor Drives, 2001, chapter 2.)
"""

from collections.abc import Mapping, Sequence

import numpy as np

from motor_sysid.physics.motors.base import (
    Array,
    Balance,
    Force,
    inertia_and_friction,
    integral_regression,
    Matrices,
    Motor,
    Output,
    stack,
    Term,
    Values,
    windows,
)
from motor_sysid.physics.motors.speed import measured_speed
from motor_sysid.physics.parameters import Parameter
from motor_sysid.signals.record import Record


def matrices(values: Values) -> Matrices:
    """Return A (P, 3, 3), B (P, 3, 1), G (P, 3, 2) over the states i, omega, theta."""
    r, inductance, k_t = values['R'], values['L'], values['k_t']
    inertia, b = values['J'], values['b']
    k_e = values['emf_ratio'] * k_t
    zero, one = np.zeros_like(r), np.ones_like(r)
    a = stack(
        [
            [-r / inductance, -k_e / inductance, zero],
            [k_t / inertia, -b / inertia, zero],
            [zero, one, zero],
        ]
    )
    g = stack([[zero, 1 / inductance], [1 / inertia, zero], [zero, zero]])
    return a, g[:, :, 1:], g


def start(records: Sequence[Record], given: Mapping[str, float]) -> dict[str, float]:
    """Read R, L, k_t, J and b from voltage and torque balances integrated over windows."""

    def electrical(record: Record, length: int) -> tuple[Array, Array]:
        dt = record.dt
        drive = windows(record['voltage'], length)[0] * dt
        charge, current = windows(record['current'], length)
        angle = windows(measured_speed(record), length)[0] * dt
        bias = np.full_like(drive, dt * length)
        return np.column_stack([charge * dt, current, angle, bias]), drive

    r, inductance, k_e, _ = integral_regression(records, electrical)
    k_t = max(k_e, 1e-6)

    def mechanical(record: Record, length: int) -> tuple[Array, Array]:
        dt = record.dt
        angle, speed = windows(measured_speed(record), length)
        charge = windows(record['current'], length)[0] * dt
        bias = np.full_like(charge, dt * length)
        return np.column_stack([speed, angle * dt, bias]), k_t * charge

    inertia, b = inertia_and_friction(records, mechanical)
    dt = records[0].dt
    r = max(r, 1e-4)
    return {
        'R': r,
        'L': float(np.clip(inductance, 0.05 * r * dt, 50 * r * dt)),
        'k_t': k_t,
        'J': inertia,
        'b': max(b, 1e-3 * k_t**2 / r),
    }


def drive_torque(values: Mapping[str, float], record: Record) -> Array:
    """Return k_t i, (N,) in N m."""
    torque: Array = values['k_t'] * record['current']
    return torque


MOTOR = Motor(
    key='brushed_dc',
    title='brushed DC motor',
    states=('i', 'omega', 'theta'),
    inputs=(('voltage',),),
    arguments=('u',),
    outputs=(
        Output('current', 'i', 'current_offset'),
        Output('speed', 'omega'),
        Output('position', 'theta'),
    ),
    forces=(Force('torque', 'omega', 'N m'), Force('voltage', 'i', 'V')),
    parameters=(
        Parameter('R', 'ohm', 1.0, 1e-4, 1e4, 'armature resistance'),
        Parameter('L', 'H', 1e-3, 1e-7, 10.0, 'armature inductance'),
        Parameter('k_t', 'N m/A', 0.05, 1e-6, 1e3, 'torque constant, and back-EMF constant'),
        Parameter('J', 'kg m^2', 1e-4, 1e-10, 1e4, 'inertia of rotor and load'),
        Parameter('b', 'N m s/rad', 1e-5, 1e-12, 1e4, 'viscous friction'),
        Parameter('current_offset', 'A', 0.0, -100.0, 100.0, 'offset of the current sensor'),
        Parameter('emf_ratio', '1', 1.0, 0.5, 2.0, 'back-EMF over torque constant', free=False),
        Parameter('omega_eps', 'rad/s', 0.1, 1e-9, 1e3, 'width of the sign of speed', free=False),
        Parameter('i_eps', 'A', 0.01, 1e-9, 1e3, 'width of the sign of current', free=False),
    ),
    balances=(
        Balance(
            'voltage',
            Term('', ('u',)),
            (
                Term('R', ('i',)),
                Term('L', ('i',), derivative=True),
                Term('k_t', ('omega',), factors=('emf_ratio',)),
            ),
        ),
        Balance(
            'torque',
            Term('k_t', ('i',)),
            (Term('J', ('omega',), derivative=True), Term('b', ('omega',))),
        ),
    ),
    matrices=matrices,
    start=start,
    drive_torque=drive_torque,
    unmeasured='brushed_dc_reduced',
)
