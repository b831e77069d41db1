"""An axis whose motion is known, and the current that the motion takes.

    i = (J domega/dt + b omega - torque effects) / k_t

Position control holds a motor where it is told, whatever the torque: what it does not show in its
motion it shows in its current.  So slow motion under position control maps cogging and friction
over the angle, and even the standstill between steps does.  Position, speed and acceleration are
inputs; there is no voltage.  ``k_t`` stays at its given value, for motion and current tell no
more: that of a data sheet, or 1, where inertia and torques are in amperes.  (The inverse dynamic
model of robot identification: Khalil and Dombre, Modeling, Identification and Control of Robots,
2002, chapter 12; cogging by position: Piccoli and Yim, Anticogging, Int. J. Robotics Research 35
(2016) 148.)

As a motor it is a current that settles in no time, `SETTLING`, at what the equation says.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from motor_sysid.physics.motors.base import (
    Array,
    Balance,
    Force,
    Matrices,
    Motor,
    Output,
    stack,
    Term,
    Values,
)
from motor_sysid.physics.parameters import Parameter
from motor_sysid.signals.record import Record

SETTLING = 1e-7
"""Time constant (s) of the current: far below any sample time."""


def matrices(values: Values) -> Matrices:
    """Return A (P, 1, 1), B (P, 1, 3), G (P, 1, 1) over the state i."""
    quick = 1 / (SETTLING * values['k_t'])
    one, zero = np.ones_like(quick), np.zeros_like(quick)
    b = stack([[quick * values['J'], quick * values['b'], zero]])
    return stack([[-one / SETTLING]]), b, stack([[-quick]])


def start(records: Sequence[Record], given: Mapping[str, float]) -> dict[str, float]:
    """Read J and b from the torque balance at every sample."""
    columns, torque = [], []
    k_t = given.get('k_t', 1.0)
    for record in records:
        ones = np.ones(len(record))
        columns.append(np.column_stack([record['acceleration'], record['speed'], ones]))
        torque.append(k_t * record['current'])
    x = np.concatenate(columns)
    scale = np.linalg.norm(x, axis=0)
    scale[scale == 0] = 1.0
    inertia, b, _ = np.linalg.lstsq(x / scale, np.concatenate(torque), rcond=1e-10)[0] / scale
    return {'J': max(float(inertia), 1e-9), 'b': max(float(b), 1e-9), 'k_t': k_t}


def drive_torque(values: Mapping[str, float], record: Record) -> Array:
    """Return k_t i, (N,) in N m."""
    torque: Array = values['k_t'] * record['current']
    return torque


MOTOR = Motor(
    key='inverse_axis',
    title='mechanical axis of known motion',
    states=('i',),
    inputs=(('acceleration', 'speed', 'position'),),
    arguments=('domega', 'omega', 'theta'),
    outputs=(Output('current', 'i', 'current_offset'),),
    forces=(Force('torque', 'i', 'N m'),),
    parameters=(
        Parameter('J', 'kg m^2', 1e-4, 1e-10, 1e6, 'inertia of rotor and load'),
        Parameter('b', 'N m s/rad', 1e-5, 1e-12, 1e6, 'viscous friction'),
        Parameter('current_offset', 'A', 0.0, -100.0, 100.0, 'current that no motion explains'),
        Parameter('k_t', 'N m/A', 1.0, 1e-9, 1e9, 'torque per current', free=False),
        Parameter('omega_eps', 'rad/s', 0.1, 1e-9, 1e3, 'width of the sign of speed', free=False),
    ),
    balances=(
        Balance(
            'torque',
            Term('', ('i',), factors=('k_t',)),
            (Term('J', ('domega',)), Term('b', ('omega',))),
        ),
    ),
    matrices=matrices,
    start=start,
    drive_torque=drive_torque,
    prompt=True,
)
