"""Three phases and the rotor's frame: Clarke and Park, with one convention for all of the package.

``theta_e = pole_pairs position + offset`` is the angle from the axis of phase a to the d axis, and
d lies on the north pole of the magnet.  With ``g = 2 pi / 3``

    x_d =  2/3 (x_a cos theta_e + x_b cos(theta_e - g) + x_c cos(theta_e + g))
    x_q = -2/3 (x_a sin theta_e + x_b sin(theta_e - g) + x_c sin(theta_e + g))

which keeps amplitudes: a balanced sine of amplitude X is a vector of length X, and the power is
``3/2 (u_d i_d + u_q i_q)``.  The magnet links phase a with ``psi_f cos theta_e``, so the back-EMF
of phase a is ``-omega_e psi_f sin theta_e``, positive q current drives forward, and phase b
follows phase a by a third of an electrical turn.  Texts that put q on the cosine measure the same
angle from the q axis: theirs is ``theta_e + pi/2``, which is the classic mix-up of 90 degrees.
(Park, AIEE Trans. 48 (1929), doi:10.1109/T-AIEE.1929.5055275, in the amplitude-invariant scaling.)
"""

import math
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motor_sysid.errors import UserError
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

PHASES = ('a', 'b', 'c')
CURRENTS = tuple(f'current_{phase}' for phase in PHASES)
SECTOR = math.pi / 3
"""Electrical angle of one Hall sector, rad."""
_ROOT_3 = math.sqrt(3)


Scalar = TypeVar('Scalar', float, Array)


def park(
    a: Scalar, b: Scalar, c: Scalar, cos: Scalar, sin: Scalar
) -> tuple[Scalar, Scalar]:
    """Return d and q of three phases, given cosine and sine of ``theta_e``."""
    alpha, beta = (2 * a - b - c) / 3, (b - c) / _ROOT_3
    return alpha * cos + beta * sin, beta * cos - alpha * sin


def inverse_park(
    d: Scalar, q: Scalar, cos: Scalar, sin: Scalar
) -> tuple[Scalar, Scalar, Scalar]:
    """Return the phases, of sum zero, of d and q, given cosine and sine of ``theta_e``."""
    alpha, beta = d * cos - q * sin, d * sin + q * cos
    side = 0.5 * _ROOT_3 * beta
    return alpha, side - 0.5 * alpha, -side - 0.5 * alpha


def to_dq(abc: ArrayLike, theta_e: ArrayLike) -> Array:
    """Return the d and q parts of three phases.

    Parameters
    ----------
    abc:
        (..., 3) phase quantities; what they have in common drops out.
    theta_e:
        (...) electrical angle of the d axis, rad.

    Returns
    -------
    Array
        (..., 2) d and q, in the unit of the phases.
    """
    x = np.asarray(abc, dtype=np.float64)
    cos, sin = np.cos(theta_e), np.sin(theta_e)
    return np.stack(park(x[..., 0], x[..., 1], x[..., 2], cos, sin), axis=-1)


def to_abc(dq: ArrayLike, theta_e: ArrayLike) -> Array:
    """Return the phases, of sum zero, whose d and q parts are given: the inverse of `to_dq`.

    Parameters
    ----------
    dq:
        (..., 2) d and q.
    theta_e:
        (...) electrical angle of the d axis, rad.

    Returns
    -------
    Array
        (..., 3) phases a, b, c.
    """
    x = np.asarray(dq, dtype=np.float64)
    return np.stack(inverse_park(x[..., 0], x[..., 1], np.cos(theta_e), np.sin(theta_e)), axis=-1)


def electrical_angle(position: ArrayLike, pole_pairs: float, offset: float = 0.0) -> Array:
    """Return ``pole_pairs position + offset`` in rad, not wrapped.

    Parameters
    ----------
    position:
        (...) angle of the shaft, rad.
    pole_pairs:
        Electrical turns per turn of the shaft.
    offset:
        Electrical angle where the position is zero, rad.

    Raises
    ------
    UserError
        If `pole_pairs` is not a whole number of at least 1.
    """
    if pole_pairs != round(pole_pairs) or pole_pairs < 1:
        raise UserError(
            f'pole_pairs = {pole_pairs:g} must be a whole number from 1 on; a motor with 14 '
            'magnet poles has 7'
        )
    return pole_pairs * np.asarray(position, dtype=np.float64) + offset


def hall_sector(theta_e: ArrayLike) -> NDArray[np.int64]:
    """Return the Hall sector, 1 to 6, of an electrical angle.

    Sector 1 reaches from 30 to 90 degrees, and each has 60 degrees: the back-EMF between the two
    phases that drive is flat in it (see `motor_sysid.control.six_step`).
    """
    turns = np.floor(np.asarray(theta_e, dtype=np.float64) / SECTOR - 0.5)
    return np.asarray(turns % 6 + 1, dtype=np.int64)


def sector_at(theta_e: float) -> int:
    """Return `hall_sector` of one angle; twenty times as fast."""
    return math.floor(theta_e / SECTOR - 0.5) % 6 + 1


def line_voltages(abc: ArrayLike) -> Array:
    """Return (..., 3) voltages ab, bc, ca between terminals from (..., 3) voltages abc."""
    x = np.asarray(abc, dtype=np.float64)
    return x - np.roll(x, -1, axis=-1)


def phases_of_line(lines: ArrayLike) -> Array:
    """Return (..., 3) phase voltages of sum zero from (..., 3) voltages ab, bc, ca."""
    x = np.asarray(lines, dtype=np.float64)
    return (x - np.roll(x, 1, axis=-1)) / 3


def with_third_current(record: Record) -> Record:
    """Return the record with the phase current that is not measured, where the other two are.

    It is minus their sum (floating neutral).
    """
    there = [name for name in CURRENTS if name in record]
    if len(there) != 2:
        return record
    (missing,) = set(CURRENTS) - set(there)
    return record.with_signal(missing, -(record[there[0]] + record[there[1]]), 'A')


def phase_columns(record: Record, kind: str) -> Array:
    """Return (N, 3) phases of `kind`, ``voltage`` or ``current``.

    One current that is not measured is minus the sum of the others (floating neutral).

    Raises
    ------
    UserError
        If they are not there.
    """
    names = [f'{kind}_{axis}' for axis in PHASES]
    if kind == 'current':
        record = with_third_current(record)
    missing = [name for name in names if name not in record]
    if missing:
        raise UserError(
            f'the record has no {" and no ".join(f"`{name}`" for name in missing)}; name the '
            'columns or fields of all phases in a msg_config file'
        )
    return np.stack([record[name] for name in names], axis=-1)


def with_dq(record: Record, pole_pairs: float, offset: float = 0.0) -> Record:
    """Return the record with `voltage_d`, `voltage_q`, `current_d`, `current_q` from its phases.

    Currents are turned by the angle at their sample, voltages, which act until the next sample,
    by the angle halfway.

    Parameters
    ----------
    record:
        With ``position`` and phase voltages, phase currents or both.
    pole_pairs, offset:
        See `electrical_angle`.

    Raises
    ------
    UserError
        If the position or every kind of phases is missing.
    """
    angle = electrical_angle(record['position'], pole_pairs, offset)
    halfway = angle + 0.5 * np.append(np.diff(angle), 0.0)
    found = [
        (kind, unit, theta)
        for kind, unit, theta in (('voltage', 'V', halfway), ('current', 'A', angle))
        if f'{kind}_a' in record or f'{kind}_b' in record
    ]
    if not found:
        raise UserError('the record has neither phase voltages nor phase currents')
    for kind, unit, theta in found:
        dq = to_dq(phase_columns(record, kind), theta)
        for k, axis in enumerate('dq'):
            record = record.with_signal(f'{kind}_{axis}', dq[:, k], unit)
    return record
