"""Brushed DC motor whose current is not measured: the speed answers the voltage.

    k_a domega/dt = u - k_v omega + torque effects
    dtheta/dt     = omega

This is the motor with the electrical transient neglected, divided by ``k_t / R``: all that voltage
and speed can tell.  ``k_v = k_e + R b / k_t`` and ``k_a = R J / k_t``; torques are in volts, the
voltage that balances them.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from motor_sysid.physics.motors.base import (
    Array,
    Balance,
    Force,
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
    """Return A (P, 2, 2), B (P, 2, 1), G (P, 2, 1) over the states omega, theta."""
    k_v, k_a = values['k_v'], values['k_a']
    zero, one = np.zeros_like(k_v), np.ones_like(k_v)
    g = stack([[1 / k_a], [zero]])
    return stack([[-k_v / k_a, zero], [one, zero]]), g, g


def start(records: Sequence[Record], given: Mapping[str, float]) -> dict[str, float]:
    """Read k_v and k_a from the voltage balance integrated over windows."""

    def balance(record: Record, length: int) -> tuple[Array, Array]:
        dt = record.dt
        angle, speed = windows(measured_speed(record), length)
        drive = windows(record['voltage'], length)[0] * dt
        return np.column_stack([speed, angle * dt, np.full_like(drive, dt * length)]), drive

    k_a, k_v, _ = integral_regression(records, balance)
    k_v = max(k_v, 1e-6)
    return {'k_v': k_v, 'k_a': max(k_a, k_v * records[0].dt)}


def drive_torque(values: Mapping[str, float], record: Record) -> Array:
    """Return the voltage that drives the rotor against back-EMF and inertia, (N,) in V."""
    return record['voltage']


MOTOR = Motor(
    key='brushed_dc_reduced',
    title='brushed DC motor, current not measured',
    states=('omega', 'theta'),
    inputs=(('voltage',),),
    arguments=('u',),
    outputs=(Output('speed', 'omega'), Output('position', 'theta')),
    forces=(Force('torque', 'omega', 'V'),),
    parameters=(
        Parameter('k_v', 'V s/rad', 0.05, 1e-7, 1e4, 'voltage per steady speed'),
        Parameter('k_a', 'V s^2/rad', 1e-3, 1e-9, 1e4, 'voltage per acceleration'),
        Parameter('omega_eps', 'rad/s', 0.1, 1e-9, 1e3, 'width of the sign of speed', free=False),
    ),
    balances=(
        Balance(
            'torque',
            Term('', ('u',)),
            (Term('k_a', ('omega',), derivative=True), Term('k_v', ('omega',))),
        ),
    ),
    matrices=matrices,
    start=start,
    drive_torque=drive_torque,
    balance='torque',
)
