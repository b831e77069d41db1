"""A position from Hall sectors: exact at the edges, a straight line in between."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.signals.phases import SECTOR
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

_FEWEST = 12


def electrical_angle_of(sectors: Array, time: Array) -> Array:
    """Return (N,) the unwrapped electrical angle in rad that goes with Hall sectors.

    Where the sector changes the angle is that of the edge; in between it is interpolated in time,
    and between two edges at which the motor turned back it rests at that edge.

    Parameters
    ----------
    sectors:
        (N,) sectors 1 to 6; sector 1 begins at 30 degrees, see
        `motor_sysid.signals.phases.hall_sector`.
    time:
        (N,) s.

    Raises
    ------
    UserError
        If a value is no sector, sectors are skipped, or the motor turned by less than two
        electrical turns.
    """
    codes = np.round(sectors).astype(np.int64)
    if np.any((codes < 1) | (codes > 6)):
        wrong = codes[(codes < 1) | (codes > 6)][0]
        raise UserError(f'`hall_sector` has a {wrong}; sectors are 1 to 6')
    steps = (np.diff(codes) + 3) % 6 - 3
    if np.any(np.abs(steps) > 1):
        at = int(np.argmax(np.abs(steps) > 1))
        raise UserError(
            f'`hall_sector` jumps from {codes[at]} to {codes[at + 1]} at {time[at]:g} s: a sector '
            'is skipped; record faster, or check the order of the sensors'
        )
    edges = np.flatnonzero(steps)
    if edges.size < _FEWEST:
        raise UserError(
            f'`hall_sector` changes {edges.size} times; a position needs at least {_FEWEST} edges'
        )
    number = codes[0] + np.concatenate(([0], np.cumsum(steps)))
    upper = np.maximum(number[edges], number[edges + 1])
    angle: Array = np.interp(
        time, 0.5 * (time[edges] + time[edges + 1]), (upper - 0.5) * SECTOR
    )
    return angle


def with_hall_position(record: Record, known: Mapping[str, float]) -> Record:
    """Return the record with a position from its Hall sectors, if it has no other.

    Parameters
    ----------
    record:
        Any record.
    known:
        What is known of the motor; `pole_pairs` is needed.

    Raises
    ------
    UserError
        If the pole pairs are not known, or the sectors make no sense.
    """
    if 'position' in record or 'hall_sector' not in record:
        return record
    if 'pole_pairs' not in known:
        raise UserError(
            'a position from `hall_sector` needs the pole pairs of the motor; give `pole_pairs` '
            'in the data sheet (--nominal) or in the model'
        )
    angle = electrical_angle_of(record['hall_sector'], record.time)
    return record.with_signal('position', angle / known['pole_pairs'], 'rad')
