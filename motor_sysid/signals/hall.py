"""Hall sectors and positions: each tells the other, and how the two lie to each other.

Sectors are numbered 1 to 6, or 0 to 5, in the order in which a forward turn passes them; the first
one begins at an electrical angle of 30 degrees (see `motor_sysid.signals.phases.hall_sector`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.signals.lattice import count_of
from motor_sysid.signals.phases import SECTOR
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

_FEWEST = 12
_MOST_PAIRS = 24

_AGREES = 0.8
"""Least length of the mean of turns from -30 to 30 degrees; it is 0.95 where all is well."""

_INSIDE, _CLOSE = 1e-6, 0.1
"""How far inside of a sector a position is put that is less than a tenth of a sector outside."""

_APART, _FEW = 1.5, 0.05
"""Sectors by which a step may differ from what the speed tells, and share of larger ones."""


def sector_codes(sectors: Array) -> NDArray[np.int64]:
    """Return (N,) sectors 1 to 6 from such ones, or from those that are counted from 0 on.

    Raises
    ------
    UserError
        If a value is no sector.
    """
    codes: NDArray[np.int64] = np.round(sectors).astype(np.int64)
    low, high = int(codes.min()), int(codes.max())
    if low == 0 and high <= 5:
        return codes + 1
    if low < 1 or high > 6:
        raise UserError(
            f'`hall_sector` goes from {low} to {high}; sectors are 1 to 6, or 0 to 5'
        )
    return codes


def electrical_angle_of(sectors: Array, time: Array, speed: Array | None = None) -> Array:
    """Return (N,) the unwrapped electrical angle in rad that goes with Hall sectors.

    Where the sector changes the angle is that of the edge; in between it is interpolated in time,
    and between two edges at which the motor turned back it rests at that edge.

    Parameters
    ----------
    sectors:
        (N,) sectors.
    time:
        (N,) s.
    speed:
        (N,) electrical speed, rad/s, if it is known: it tells how many sectors were passed between
        two samples.

    Raises
    ------
    UserError
        If a value is no sector, sectors are skipped, do not go with the speed, or the motor turned
        by less than two electrical turns.
    """
    codes = sector_codes(sectors)
    steps = (np.diff(codes) + 3) % 6 - 3
    expected = np.zeros(steps.size)
    if speed is not None:
        expected = 0.5 * (speed[1:] + speed[:-1]) * np.diff(time) / SECTOR
        expected = np.nan_to_num(expected)  # what is not finite is refused later, by its name
        steps = steps + 6 * np.round((expected - steps) / 6).astype(np.int64)
    edges = np.flatnonzero(steps)
    apart = edges[np.abs(steps - expected)[edges] > _APART]
    if apart.size > (0.0 if speed is None else _FEW * edges.size):
        at = int(apart[0])
        jump = f'`hall_sector` jumps from {codes[at]} to {codes[at + 1]} at {time[at]:g} s'
        if speed is None:
            raise UserError(
                f'{jump}: a sector is skipped; record faster or with the speed, or check the '
                'order of the sensors'
            )
        raise UserError(
            f'{jump}, where the speed tells {expected[at]:+.1f} sectors from sample to sample; '
            'check `pole_pairs`, sign and unit of the speed, and the order of the sensors'
        )
    if edges.size < _FEWEST:
        raise UserError(
            f'`hall_sector` changes {edges.size} times; a position needs at least {_FEWEST} edges'
        )
    number = codes[0] + np.concatenate(([0], np.cumsum(steps)))
    middle = 0.5 * (number[edges] + number[edges + 1])
    angle: Array = np.interp(time, 0.5 * (time[edges] + time[edges + 1]), middle * SECTOR)
    return angle


def pole_pairs_of(records: Sequence[Record]) -> float:
    """Return the pole pairs with which Hall sectors and positions agree best.

    Raises
    ------
    UserError
        If no record has both, or no number stands out.
    """
    both = _moving(records)
    agreement = [abs(_mean_turn(both, pairs)) for pairs in range(1, _MOST_PAIRS + 1)]
    if not both or max(agreement) < _AGREES:
        raise UserError(
            'these records do not tell the pole pairs of the motor: that takes positions over '
            'some turns and Hall sectors that are numbered in the order of a forward turn; give '
            '`pole_pairs` in the data sheet (--nominal) or in the model'
        )
    return 1.0 + int(np.argmax(agreement))


def angle_offset_of(records: Sequence[Record], pole_pairs: float) -> float:
    """Return the electrical angle at position zero in rad, read from Hall sectors; 0 without.

    An encoder that counts full steps is half a step behind on average; that is part of it.  The
    offset of records that `within_sectors` has seen to is the one that it was given.

    Raises
    ------
    UserError
        If sectors and positions do not go together.
    """
    both = _moving(records)
    if not both:
        return 0.0
    turn = _mean_turn(both, pole_pairs)
    if abs(turn) < _AGREES:
        raise UserError(
            f'`hall_sector` does not go with the position and {pole_pairs:g} pole pairs: they '
            f'agree to {abs(turn):.2f}, and should to {_AGREES:g} (1 is perfect); number the '
            'sectors in the order of a forward turn (no Gray code), check the sign of the '
            'position and `pole_pairs`, or leave `hall_sector` out'
        )
    found = float(np.angle(turn))
    begins = np.concatenate([
        (sector_codes(r['hall_sector']) - 0.5) * SECTOR - pole_pairs * r['position'] for r in both
    ]) - found  # fmt: skip
    begins = (begins + np.pi) % (2 * np.pi) - np.pi
    ends, near = begins + SECTOR, _CLOSE * SECTOR
    return found + 0.5 * float(np.max(begins[begins < near]) + np.min(ends[ends > -near]))


def within_sectors(record: Record, pole_pairs: float, offset: float) -> Record:
    """Return the record with positions moved into their Hall sectors, where they are close by.

    Where the position comes in counts, half a count inside: all of what such a position may mean
    lies in the sector then.  The width of a count stays known.
    """
    if 'position' not in record or 'hall_sector' not in record:
        return record
    count = record.steps.get('position') or count_of(record['position'])
    margin = min(0.5 * pole_pairs * count / SECTOR + _INSIDE, 0.5)
    place = (pole_pairs * record['position'] + offset) / SECTOR - 0.5
    code = sector_codes(record['hall_sector']) - 1
    low = code + 6.0 * np.round((place - code - 0.5) / 6.0)
    close = (place > low - _CLOSE) & (place < low + 1.0 + _CLOSE)
    moved = np.where(close, np.clip(place, low + margin, low + 1.0 - margin), place)
    angle = ((moved + 0.5) * SECTOR - offset) / pole_pairs
    inside = record.with_signal('position', angle, record.units['position'])
    count = min(count, 2 * (margin - _INSIDE) * SECTOR / pole_pairs)
    return replace(inside, steps={**inside.steps, 'position': count}) if count else inside


def _moving(records: Sequence[Record]) -> list[Record]:
    return [
        r for r in records
        if 'position' in r and 'hall_sector' in r and np.ptp(r['hall_sector']) > 0
    ]  # fmt: skip


def _mean_turn(records: Sequence[Record], pole_pairs: float) -> complex:
    """Return the mean of exp(j (middle of the sector - electrical angle)); 0 without records."""
    turns = [
        np.exp(1j * (sector_codes(r['hall_sector']) * SECTOR - pole_pairs * r['position']))
        for r in records
    ]
    return complex(np.mean(np.concatenate(turns))) if turns else 0j


def with_hall_position(record: Record, known: Mapping[str, float]) -> Record:
    """Return the record with a position from its Hall sectors, if it has no other.

    What was recorded of it are steps of a sector.

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
    pairs = known['pole_pairs']
    speed = pairs * record['speed'] if 'speed' in record else None
    angle = electrical_angle_of(record['hall_sector'], record.time, speed)
    made = record.with_signal('position', angle / pairs, 'rad')
    return replace(made, steps={**made.steps, 'position': SECTOR / pairs})
