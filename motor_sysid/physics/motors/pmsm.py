"""Permanent magnet synchronous motor in rotor coordinates, the d axis on the magnet.

    L_d di_d/dt = u_d - R i_d + omega_e L_q i_q                 + voltage_d effects
    L_q di_q/dt = u_q - R i_q - omega_e (L_d i_d + psi_f)       + voltage_q effects
    J domega/dt = 1.5 pole_pairs (psi_f i_q + (L_d - L_q) i_d i_q) - b omega + torque effects
    dtheta/dt   = omega,   omega_e = pole_pairs omega

Amplitudes are those of a phase; what the magnet does where it is not quite on the recorded d axis
(`frame_error`) and what each axis puts into the other is in `pmsm_laws`.  The current
sensors sit in phases a and b: their offsets turn with the rotor, so that the record's position
must be there to tell them.  (Krishnan, Electric Motor Drives, 2001, chapter 9.)
"""

from collections.abc import Mapping, Sequence
import math

import numpy as np

from motor_sysid.errors import UserError
from motor_sysid.physics.effect_file import load_effect
from motor_sysid.physics.motors import pmsm_laws
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
from motor_sysid.physics.motors.pole_pairs import pole_pairs_of
from motor_sysid.physics.motors.speed import measured_speed
from motor_sysid.physics.parameters import Parameter, ParameterSet
from motor_sysid.signals.record import Record

MOST_TURNED = 0.5
"""Electrical angle (rad) between the magnet and the recorded d axis that a fit makes up for."""

ASKEW = math.radians(3.0)
"""Electrical angle from the recorded d axis to the magnet from which on it is spoken of."""

LONGEST_HOLD = 250e-6
"""Longest time, s, for which a drive holds the voltages of its terminals: one period at 4 kHz."""


def matrices(values: Values) -> Matrices:
    """Return A (P, 4, 4), B (P, 4, 2), G (P, 4, 3) over the states i_d, i_q, omega, theta."""
    r, l_d, l_q = values['R'], values['L_d'], values['L_q']
    inertia, b = values['J'], values['b']
    linkage = values['pole_pairs'] * values['psi_f']
    zero, one = np.zeros_like(r), np.ones_like(r)
    a = stack(
        [
            [-r / l_d, zero, zero, zero],
            [zero, -r / l_q, -linkage / l_q, zero],
            [zero, 1.5 * linkage / inertia, -b / inertia, zero],
            [zero, zero, one, zero],
        ]
    )
    g = stack(
        [
            [zero, 1 / l_d, zero],
            [zero, zero, 1 / l_q],
            [1 / inertia, zero, zero],
            [zero, zero, zero],
        ]
    )
    return a, g[:, :, 1:], g


def start(records: Sequence[Record], given: Mapping[str, float]) -> dict[str, float]:
    """Read the parameters from voltage and torque balances integrated over windows.

    Raises
    ------
    UserError
        If the pole pairs are neither given nor to be told from the records, or if the axes of the
        records are not those of the magnet.
    """
    pairs = given.get('pole_pairs') or _pole_pairs(records)
    r, l_d, l_q, linkage, turned = _electrical(records, pairs)
    if abs(turned) > MOST_TURNED:
        raise UserError(
            f'the back-EMF of these records lies {math.degrees(turned):.0f} electrical degrees '
            'ahead of the q axis: their position zero is not on the d axis (the magnet). Turn '
            'voltages and currents by that angle, or name the right offset; see docs/notation.md'
        )
    psi = max(linkage / pairs, 1e-7)
    values = {'pole_pairs': pairs, 'psi_f': psi, 'L_d': l_d, 'L_q': l_q, 'frame_error': turned}

    def mechanical(record: Record, length: int) -> tuple[Array, Array]:
        dt, speed = record.dt, measured_speed(record)
        torque = areas(drive_torque(values, record), length, dt)
        bias = np.full_like(torque, dt * length)
        columns = [windows(speed, length)[1], areas(speed, length, dt), bias]
        return np.column_stack(columns), torque

    inertia, b = inertia_and_friction(records, mechanical)
    lossy = 1.5e-3 * (pairs * psi) ** 2 / r
    return {**values, 'R': r, 'J': inertia, 'b': max(b, lossy)}


def _electrical(
    records: Sequence[Record], pairs: float
) -> tuple[float, float, float, float, float]:
    """Return R, L_d, L_q, the back-EMF constant and its angle from both voltage balances.

    Both axes are taken with the inductance from one to the other that turned axes have.
    """

    def balances(record: Record, length: int) -> tuple[Array, Array]:
        columns, drive = _terms(record, length)
        r_d, l_d, speed_q, r_q, l_q, speed_d, emf = columns
        zero = np.zeros_like(emf)
        across_d, across_q = l_q - pairs * speed_d, l_d + pairs * speed_q
        d = np.column_stack([r_d, l_d, -pairs * speed_q, across_d, zero, -emf])
        q = np.column_stack([r_q, pairs * speed_d, l_q, across_q, emf, zero])
        return np.concatenate([d, q]), drive

    r, own_d, own_q, _, linkage, side = (float(v) for v in integral_regression(records, balances))
    r = max(r, 1e-4)
    slowest = 50 * r * records[0].dt
    turned = math.atan2(side, linkage)
    upright = float(np.clip(turned, -MOST_TURNED, MOST_TURNED))
    mean, apart = 0.5 * (own_d + own_q), 0.5 * (own_d - own_q) / math.cos(2 * upright)
    l_q = float(np.clip(mean - apart, 1e-3 * slowest, slowest))
    l_d = float(np.clip(mean + apart, 0.1 * l_q, 10 * l_q))
    return r, l_d, l_q, math.hypot(linkage, side), turned


def _terms(record: Record, length: int) -> tuple[list[Array], Array]:
    """Return what stands beside R, L_d, pole_pairs L_q; R, L_q, pole_pairs L_d and the EMF."""
    dt, speed = record.dt, measured_speed(record)
    parts = []
    for axis, other in ('dq', 'qd'):
        own, other_one = record[f'current_{axis}'], record[f'current_{other}']
        crossed = areas(speed * other_one, length, dt)
        parts += [areas(own, length, dt), windows(own, length)[1], crossed]
    parts.append(areas(speed, length, dt))
    drive = [windows(record[f'voltage_{axis}'], length)[0] * dt for axis in 'dq']
    return parts, np.concatenate(drive)


def _pole_pairs(records: Sequence[Record]) -> float:
    """Return the pole pairs that the records single out.

    Raises
    ------
    UserError
        If the records do not tell them.
    """
    pairs = pole_pairs_of(records)
    if not pairs:
        raise UserError(
            'these records do not tell the pole pairs of the motor; give them: `pole_pairs` in '
            'the data sheet (--nominal) or in the model; or fit the mechanical side alone, driven '
            'by the q current (--motor mechanical_axis)'
        )
    return float(pairs)


def drive_torque(values: Mapping[str, float], record: Record) -> Array:
    """Return 1.5 pole_pairs (psi_f i_q + (L_d - L_q) i_d i_q), (N,) in N m.

    The currents are those on the axes of the magnet, `frame_error` ahead of the record's.
    """
    c, s = math.cos(values['frame_error']), math.sin(values['frame_error'])
    d, q = record['current_d'], record['current_q']
    i_d, i_q = c * d + s * q, c * q - s * d
    linkage = values['psi_f'] + (values['L_d'] - values['L_q']) * i_d
    torque: Array = 1.5 * values['pole_pairs'] * linkage * i_q
    return torque


def remark(parameters: ParameterSet) -> str:
    """Say so if the magnet lies beside the d axis of the records for certain, or nothing."""
    p, pairs = parameters['frame_error'], parameters['pole_pairs'].value
    if p.sigma is None or abs(p.value) < max(ASKEW, 2.0 * p.sigma):
        return ''
    degrees, lost = math.degrees(p.value), 100 * (1 - math.cos(p.value))
    return (
        f'The magnet lies {abs(degrees):.3g} electrical degrees '
        f'{"ahead of" if degrees > 0 else "behind"} the d axis that the drive takes '
        f'({abs(degrees) / pairs:.2g} of the shaft): a q current makes {lost:.2g} % less torque, '
        'and a d current makes some. To do: turn the zero of its rotor angle by '
        f'{degrees:+.3g} electrical degrees'
    )


MOTOR = Motor(
    key='pmsm',
    title='permanent magnet synchronous motor',
    states=('i_d', 'i_q', 'omega', 'theta'),
    inputs=(('voltage_d', 'voltage_q'),),
    arguments=('u_d', 'u_q'),
    outputs=(
        Output('current_d', 'i_d'),
        Output('current_q', 'i_q'),
        Output('speed', 'omega'),
        Output('position', 'theta'),
    ),
    forces=(
        Force('torque', 'omega', 'N m'),
        Force('voltage_d', 'i_d', 'V'),
        Force('voltage_q', 'i_q', 'V'),
    ),
    parameters=(
        Parameter('R', 'ohm', 1.0, 1e-4, 1e4, 'resistance of a phase'),
        Parameter('L_d', 'H', 1e-3, 1e-7, 10.0, 'inductance on the magnet'),
        Parameter('L_q', 'H', 1e-3, 1e-7, 10.0, 'inductance across the magnet'),
        Parameter('psi_f', 'V s/rad', 0.01, 1e-7, 1e2, 'flux linkage of the magnet'),
        Parameter('J', 'kg m^2', 1e-4, 1e-10, 1e4, 'inertia of rotor and load'),
        Parameter('b', 'N m s/rad', 1e-5, 1e-12, 1e4, 'viscous friction'),
        Parameter('current_offset_a', 'A', 0.0, -100.0, 100.0, 'offset of the sensor in phase a'),
        Parameter('current_offset_b', 'A', 0.0, -100.0, 100.0, 'offset of the sensor in phase b'),
        Parameter(
            'frame_error', 'rad', 0.0, -MOST_TURNED, MOST_TURNED,
            'electrical angle of the magnet ahead of the recorded d axis',
        ),
        Parameter(
            'hold_squared', 's^2', 0.0, -(LONGEST_HOLD**2), LONGEST_HOLD**2,
            'square of the time for which a voltage stands still in the stator',
        ),
        Parameter('pole_pairs', '1', 4.0, 1.0, 64.0, 'electrical turns in one turn', free=False),
        Parameter(
            'angle_offset', 'rad', 0.0, -7.0, 7.0, 'electrical angle at position zero', free=False
        ),
        Parameter('omega_eps', 'rad/s', 0.1, 1e-9, 1e3, 'width of the sign of speed', free=False),
        Parameter('i_eps', 'A', 0.01, 1e-9, 1e3, 'width of the sign of current', free=False),
    ),
    balances=(
        Balance(
            'voltage_d',
            Term('', ('u_d',)),
            (
                Term('R', ('i_d',)),
                Term('L_d', ('i_d',), derivative=True),
                Term('L_q', ('emf_d',)),
            ),
        ),
        Balance(
            'voltage_q',
            Term('', ('u_q',)),
            (
                Term('R', ('i_q',)),
                Term('L_q', ('i_q',), derivative=True),
                Term('L_d', ('emf_q',)),
                Term('psi_f', ('omega',), factors=('pole_pairs',)),
            ),
        ),
        Balance(
            'torque',
            Term('psi_f', ('lift',)),
            (Term('J', ('omega',), derivative=True), Term('b', ('omega',))),
            given=(Term('L_q', ('pull',)), Term('L_d', ('pull',), sign=-1.0)),
        ),
    ),
    matrices=matrices,
    start=start,
    drive_torque=drive_torque,
    frame='dq',
    own=load_effect('pmsm', pmsm_laws),
    derived={
        name: getattr(pmsm_laws, name) for name in ('emf_d', 'emf_q', 'lift', 'pull')
    },
    shown=('current_offset_a', 'current_offset_b'),
    wave='pole_pairs',
    unmeasured='pmsm_q',
    blurred='mechanical_axis',
    remark=remark,
)
