"""A mechanical axis driven by a known torque, force or current.

    J domega/dt = gain u - b omega + torque effects
    dtheta/dt   = omega

For a linear axis read mass for ``J``, force for torque, speed and position in m/s and m.  With a
current as input (that of a brushed motor, or the q current) the gain is the torque constant; only
``J / gain`` and ``b / gain`` can be seen then, so the gain stays at its given value: that of a
data sheet, or 1, where torques are in ampere.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from motor_sysid.physics.motors.base import (
    Array,
    Balance,
    Force,
    inertia_and_friction,
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
from motor_sysid.signals.channels import DRIVING_CURRENTS
from motor_sysid.signals.record import Record

INPUTS = (('torque',), ('force',), ('current',), ('current_q',))


def matrices(values: Values) -> Matrices:
    """Return A (P, 2, 2), B (P, 2, 1), G (P, 2, 1) over the states omega, theta."""
    inertia, b, gain = values['J'], values['b'], values['gain']
    zero, one = np.zeros_like(inertia), np.ones_like(inertia)
    a = stack([[-b / inertia, zero], [one, zero]])
    return a, stack([[gain / inertia], [zero]]), stack([[1 / inertia], [zero]])


def start(records: Sequence[Record], given: Mapping[str, float]) -> dict[str, float]:
    """Read J and b from the torque balance integrated over windows."""
    gain = _gain(records, given)

    def balance(record: Record, length: int) -> tuple[Array, Array]:
        dt = record.dt
        angle, speed = windows(measured_speed(record), length)
        torque = gain * windows(record[_drive(record)], length)[0] * dt
        return np.column_stack([speed, angle * dt, np.full_like(torque, dt * length)]), torque

    inertia, b = inertia_and_friction(records, balance)
    return {'J': inertia, 'b': max(b, 1e-3 * inertia / records[0].duration), 'gain': gain}


def _drive(record: Record) -> str:
    """Return the name of the signal that drives the axis."""
    return next(name for (name,) in INPUTS if name in record)


def _gain(records: Sequence[Record], given: Mapping[str, float]) -> float:
    """Return the torque per unit of input: what is given, or the torque constant of a current."""
    if 'gain' in given or not {_drive(record) for record in records} <= {*DRIVING_CURRENTS}:
        return given.get('gain', 1.0)
    magnet = 1.5 * given.get('pole_pairs', 0.0) * given.get('psi_f', 0.0)
    return given.get('k_t') or magnet or 1.0


def drive_torque(values: Mapping[str, float], record: Record) -> Array:
    """Return gain times input, (N,) in N m or N."""
    torque: Array = values['gain'] * record[_drive(record)]
    return torque


MOTOR = Motor(
    key='mechanical_axis',
    title='mechanical axis',
    states=('omega', 'theta'),
    inputs=INPUTS,
    arguments=('u',),
    outputs=(Output('speed', 'omega'), Output('position', 'theta')),
    forces=(Force('torque', 'omega', 'N m'),),
    parameters=(
        Parameter('J', 'kg m^2', 1e-3, 1e-10, 1e6, 'inertia (mass of a linear axis)'),
        Parameter('b', 'N m s/rad', 1e-3, 1e-12, 1e6, 'viscous friction'),
        Parameter('gain', '1', 1.0, 1e-9, 1e9, 'torque per unit of input', free=False),
        Parameter('omega_eps', 'rad/s', 0.1, 1e-9, 1e3, 'width of the sign of speed', free=False),
    ),
    balances=(
        Balance(
            'torque',
            Term('', ('u',), factors=('gain',)),
            (Term('J', ('omega',), derivative=True), Term('b', ('omega',))),
        ),
    ),
    matrices=matrices,
    start=start,
    drive_torque=drive_torque,
    driven=True,
)
