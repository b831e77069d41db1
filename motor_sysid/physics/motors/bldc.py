"""Brushless motor with trapezoidal back-EMF, star connected, its star point floating.

    L di_a/dt   = (2 u_a - u_b - u_c)/3 - R i_a - e_a + mean of e   + voltage_a effects
    L di_b/dt   = (2 u_b - u_a - u_c)/3 - R i_b - e_b + mean of e   + voltage_b effects
    J domega/dt = (e_a i_a + e_b i_b + e_c i_c) / omega - b omega   + torque effects
    dtheta/dt   = omega,   i_c = -i_a - i_b,   e_x = -k_e omega f_x(theta)

``u_x`` are the voltages of the terminals against any common point, as measured: these equations
hold as well while a phase is switched off and its terminal shows what the motor induces.  L is the
inductance of a phase less that between phases.  The trapezoid f is in `bldc_laws`.
(Krishnan, Electric Motor Drives, 2001, section 9.8.)
"""

from collections.abc import Mapping, Sequence

import numpy as np

from motor_sysid.errors import UserError
from motor_sysid.physics.effect_file import load_effect
from motor_sysid.physics.laws import PI, THIRD
from motor_sysid.physics.motors import bldc_laws
from motor_sysid.physics.motors.base import (
    areas,
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

_SHORT = 4
_MOST_PAIRS = 24
_CLEAR = 0.8
_ORDERS = (1, 5, 7)


def matrices(values: Values) -> Matrices:
    """Return A (P, 4, 4), B (P, 4, 3), G (P, 4, 3) over the states i_a, i_b, omega, theta."""
    r, inductance, inertia, b = values['R'], values['L'], values['J'], values['b']
    zero, one = np.zeros_like(r), np.ones_like(r)
    a = stack(
        [
            [-r / inductance, zero, zero, zero],
            [zero, -r / inductance, zero, zero],
            [zero, zero, -b / inertia, zero],
            [zero, zero, one, zero],
        ]
    )
    third = 1 / (3 * inductance)
    drive = stack(
        [
            [2 * third, -third, -third],
            [-third, 2 * third, -third],
            [zero, zero, zero],
            [zero, zero, zero],
        ]
    )
    g = stack(
        [
            [zero, 1 / inductance, zero],
            [zero, zero, 1 / inductance],
            [1 / inertia, zero, zero],
            [zero, zero, zero],
        ]
    )
    return a, drive, g


def typical(values: Values) -> Matrices:
    """Return A, B, G of the motor that stands where phases a and b carry the current."""
    a, drive, g = matrices(values)
    k_e = values['k_e']
    for phase, sign in ((0, 1.0), (1, -1.0)):
        a[:, phase, 2] = -sign * k_e / values['L']
        a[:, 2, phase] = sign * k_e / values['J']
        drive[:, phase] = 0.0
        drive[:, phase, 0] = sign * 0.5 / values['L']
    return a, drive, g


def start(records: Sequence[Record], given: Mapping[str, float]) -> dict[str, float]:
    """Read the parameters from voltage and torque balances integrated over windows.

    The back-EMF is first taken for a sum of waves over the electrical turn, which tell its size
    and the angle at position zero.

    Raises
    ------
    UserError
        If the pole pairs are neither given nor to be told from the records.
    """
    pairs = given.get('pole_pairs') or _pole_pairs(records)
    found = _electrical(records, pairs)
    r, inductance, cosine, sine = (float(v) for v in found[:4])
    flat = given.get('flat', 2 * PI / 3)
    flank = 0.5 * (PI - flat)
    values = {
        'pole_pairs': pairs,
        'flat': flat,
        'corner': given.get('corner', 0.1),
        'k_e': max(np.hypot(cosine, sine) * flank * PI / (4 * np.sin(flank)), 1e-6),
        'angle_offset': float(np.arctan2(cosine, sine)),
    }

    def mechanical(record: Record, length: int) -> tuple[Array, Array]:
        dt, speed = record.dt, measured_speed(record)
        torque = areas(drive_torque(values, record), length, dt)
        bias = np.full_like(torque, dt * length)
        columns = [windows(speed, length)[1], areas(speed, length, dt), bias]
        return np.column_stack(columns), torque

    inertia, b = inertia_and_friction(records, mechanical)
    r, dt = max(r, 1e-4), records[0].dt
    return {
        **values,
        'R': r,
        'L': float(np.clip(inductance, 0.05 * r * dt, 50 * r * dt)),
        'J': inertia,
        'b': max(b, 1e-3 * values['k_e'] ** 2 / r),
    }


def _electrical(records: Sequence[Record], pairs: float) -> Array:
    """Return R, L, and cosine and sine of the back-EMF for each order of its waves."""

    def balances(record: Record, length: int) -> tuple[Array, Array]:
        return _columns(record, pairs, min(length, _SHORT))

    return integral_regression(records, balances)


def _columns(record: Record, pairs: float, length: int) -> tuple[Array, Array]:
    """Return regressors and drive of phases a and b, integrated over windows."""
    dt, rows, drives = record.dt, [], []
    u = {x: record[f'voltage_{x}'] for x in 'abc'}
    star = (u['a'] + u['b'] + u['c']) / 3
    speed, angle = measured_speed(record), pairs * position_of(record)
    for phase, shift in (('a', 0.0), ('b', THIRD)):
        current = record[f'current_{phase}']
        columns = [areas(current, length, dt), windows(current, length)[1]]
        for n in _ORDERS:
            turned = n * (angle - shift)
            for wave in (np.cos(turned), np.sin(turned)):
                columns.append(areas(-speed * wave, length, dt))
        rows.append(np.column_stack(columns))
        drives.append(windows(u[phase] - star, length)[0] * dt)
    return np.concatenate(rows), np.concatenate(drives)


def _pole_pairs(records: Sequence[Record]) -> float:
    """Return the pole pairs with which the back-EMF repeats.

    Raises
    ------
    UserError
        If no number stands out.
    """
    left = []
    for pairs in range(1, _MOST_PAIRS + 1):
        found, total = _electrical(records, pairs), 0.0
        for record in records:
            x, y = _columns(record, pairs, _SHORT)
            total += float(np.sum((y - x @ found) ** 2))
        left.append(total)
    best = int(np.argmin(left))
    if not left[best] < _CLEAR * np.partition(left, 1)[1]:
        raise UserError(
            'these records do not tell the pole pairs of the motor; give them: `pole_pairs` in '
            'the data sheet (--nominal) or in the model'
        )
    return float(best + 1)


def position_of(record: Record) -> Array:
    """Return (N,) the measured position in rad.

    Raises
    ------
    UserError
        If there is none: a brushless motor cannot be told without its angle.
    """
    if 'position' not in record:
        raise UserError(
            'a brushless motor needs its position; name the column or topic for it, or give '
            '`hall_sector`'
        )
    return record['position']


def drive_torque(values: Mapping[str, float], record: Record) -> Array:
    """Return -k_e (f_a i_a + f_b i_b + f_c i_c), (N,) in N m."""
    wave = [values[name] for name in ('k_e', 'pole_pairs', 'angle_offset', 'flat', 'corner')]
    i_a, i_b = record['current_a'], record['current_b']
    torque: Array = bldc_laws.torque(i_a, i_b, position_of(record), *wave)  # type: ignore[arg-type, assignment]
    return torque


MOTOR = Motor(
    key='bldc',
    title='brushless motor',
    states=('i_a', 'i_b', 'omega', 'theta'),
    inputs=(('voltage_a', 'voltage_b', 'voltage_c'),),
    arguments=('u_a', 'u_b', 'u_c'),
    outputs=(
        Output('current_a', 'i_a', 'current_offset_a'),
        Output('current_b', 'i_b', 'current_offset_b'),
        Output('speed', 'omega'),
        Output('position', 'theta'),
    ),
    forces=(
        Force('torque', 'omega', 'N m'),
        Force('voltage_a', 'i_a', 'V'),
        Force('voltage_b', 'i_b', 'V'),
    ),
    parameters=(
        Parameter('R', 'ohm', 1.0, 1e-4, 1e4, 'resistance of a phase'),
        Parameter('L', 'H', 1e-3, 1e-7, 10.0, 'inductance of a phase less the mutual one'),
        Parameter('k_e', 'V s/rad', 0.03, 1e-6, 1e3, 'height of the back-EMF of a phase'),
        Parameter('J', 'kg m^2', 1e-4, 1e-10, 1e4, 'inertia of rotor and load'),
        Parameter('b', 'N m s/rad', 1e-5, 1e-12, 1e4, 'viscous friction'),
        Parameter('current_offset_a', 'A', 0.0, -100.0, 100.0, 'offset of the sensor in phase a'),
        Parameter('current_offset_b', 'A', 0.0, -100.0, 100.0, 'offset of the sensor in phase b'),
        Parameter('angle_offset', 'rad', 0.0, -7.0, 7.0, 'electrical angle at position zero'),
        Parameter('flat', 'rad', 2.0944, 0.1, 3.0, 'electrical width of the flat top'),
        Parameter('corner', '1', 0.1, 0.01, 1.0, 'rounding of its corners over half a flank'),
        Parameter('pole_pairs', '1', 4.0, 1.0, 64.0, 'electrical turns in one turn', free=False),
        Parameter('omega_eps', 'rad/s', 0.1, 1e-9, 1e3, 'width of the sign of speed', free=False),
        Parameter('i_eps', 'A', 0.01, 1e-9, 1e3, 'width of the sign of current', free=False),
    ),
    balances=(
        Balance(
            'voltage_a',
            Term('', ('drive_a',)),
            (
                Term('R', ('i_a',)),
                Term('L', ('i_a',), derivative=True),
                Term('k_e', ('emf_a',)),
            ),
        ),
        Balance(
            'voltage_b',
            Term('', ('drive_b',)),
            (
                Term('R', ('i_b',)),
                Term('L', ('i_b',), derivative=True),
                Term('k_e', ('emf_b',)),
            ),
        ),
        Balance(
            'torque',
            Term('k_e', ('lift',)),
            (Term('J', ('omega',), derivative=True), Term('b', ('omega',))),
        ),
    ),
    matrices=matrices,
    start=start,
    drive_torque=drive_torque,
    frame='abc',
    own=load_effect('bldc', bldc_laws),
    derived={
        name: getattr(bldc_laws, name)
        for name in ('drive_a', 'drive_b', 'emf_a', 'emf_b', 'lift')
    },
    typical=typical,
    wave='pole_pairs',
)
