"""How much of a record is held back to judge on: its last part, if the motor moves there."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.names import listed
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.motors.base import Motor
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

DULL = 0.5
"""Share of its due (as much of the motion as of the time) below which a last part tells too little
to judge on."""

MOST_HELD = 0.5
"""Share of a record beyond which no more is held back."""

STILL, STEADY = 0.02, 0.15
"""Deviation of an input over its size, and of the speed over its deviation in the whole record,
below which a last part shows one state and nothing of how the motor comes to it."""

IDLE, AFTER = 0.02, 0.1
"""Step of the motion over the largest one up to which a motor rests, and how much of an idle end
is left of a record, as a share of what comes before it."""

SEVERAL = 3
"""Records from which on one may be held back as a whole."""


def parted(
    train: Sequence[Record], validation: Sequence[Record], kind: Motor, fraction: float
) -> tuple[list[Record], list[tuple[Record, float]], tuple[str, ...]]:
    """Return the records to fit, all with the share that is fitted, and what is to be said of it.

    Without validation records the last part of each is held back, see `kept`; or the last one of
    several as a whole, if every last part is steady.  The end of a record in which nothing moves
    is left out if it is longer than all before it: a recorder that went on after the run.
    """
    said: tuple[str, ...] = ()
    if not validation:
        train, said = _without_idle_ends(train, kind)
    several = not validation and len(train) >= SEVERAL
    if several and all(_is_steady(record, kind, fraction) for record in train):
        count = max(round(fraction * len(train)), 1)
        train, validation = train[:-count], train[-count:]
        names = listed(r.provenance.source for r in validation if r.provenance.source)
        said += (
            f'neither input nor speed changes in the last {fraction:.0%} of any record: what is '
            f'held back to judge on is the whole of {names or f"the last {count}"}',
        )
    parts = [(r, 1.0 if validation else kept(r, fraction)) for r in train]
    parts += [(r, 0.0) for r in validation]
    more = () if validation else remarks_on_held(train, fraction)
    return list(train), parts, (*said, *more)


def _without_idle_ends(
    records: Sequence[Record], kind: Motor
) -> tuple[list[Record], tuple[str, ...]]:
    """Return records without most of an end in which nothing moves, and what was left out."""
    kept_rows = [_busy(record, kind) for record in records]
    said = tuple(
        f'{f"{r.provenance.source}: " if r.provenance.source else ""}neither the input nor the '
        f'motor moves in the last {r.duration - r.time[n - 1] + r.time[0]:.3g} s: left out'
        for r, n in zip(records, kept_rows, strict=True) if n < len(r)
    )  # fmt: skip
    pairs = zip(records, kept_rows, strict=True)
    return [r if n == len(r) else r.slice(0, n) for r, n in pairs], said


def _busy(record: Record, kind: Motor) -> int:
    """Return how many rows of a record are left without an idle end; all if that is short."""
    motion, moves = _steps(record), np.zeros(len(record), dtype=np.bool_)
    inputs = [record[name] for name in input_signals(record, kind)]
    for steps in (motion, *(np.diff(u, prepend=u[:1]) for u in inputs)):
        if steps.size:
            moves |= np.abs(steps) > IDLE * np.max(np.abs(steps))
    if not motion.size or not np.any(moves):
        return len(record)
    end = int(np.flatnonzero(moves)[-1]) + 1
    return len(record) if 2 * end > len(record) else round((1.0 + AFTER) * end)


def _is_steady(record: Record, kind: Motor, fraction: float) -> bool:
    """Whether neither an input nor the speed changes in the last part of a record."""
    first = round(kept(record, fraction) * len(record))
    inputs = [record[name] for name in input_signals(record, kind)]
    held = all(np.std(u[first:]) <= STILL * np.sqrt(np.mean(u**2)) for u in inputs)
    speed = record['speed'] if 'speed' in record else np.empty(0)
    return bool(held and speed.size and np.std(speed[first:]) <= STEADY * np.std(speed))


def kept(record: Record, fraction: float) -> float:
    """Return the share of a record, 0 to 1, that is fitted; the rest is held back.

    That is all but the last `fraction`, or less: where the motor hardly moves at the end of its
    record, every model is right there, and percents of that motion mean nothing.  What is held
    back then begins early enough to have its due of the way that the motor makes, up to
    `MOST_HELD` of the record or the `fraction` that was asked for, if that is more.
    """
    travel = _travel(record)
    asked = 1.0 - fraction
    if travel.size == 0 or travel[-1] == 0.0:
        return asked
    travel /= travel[-1]
    if 1.0 - travel[min(round(asked * travel.size), travel.size - 1)] >= DULL * fraction:
        return asked
    enough = float(np.searchsorted(travel, asked, side='right')) / travel.size
    return min(asked, max(enough, 1.0 - MOST_HELD))


def remarks_on_held(records: Sequence[Record], fraction: float) -> tuple[str, ...]:
    """Say of which records more is held back than was asked for, and why."""
    said = []
    for record in records:
        share = 1.0 - kept(record, fraction)
        if share > fraction + 1e-9:
            source = record.provenance.source
            said.append(
                f'{f"{source}: " if source else ""}less than half of its due of the '
                f'motion lies in the last {fraction:.0%} of the record: the last {share:.0%} are '
                'held back to judge on'
            )
    return tuple(said)


def _travel(record: Record) -> Array:
    """Return the way that the motor has made by each sample (N,), in any unit, or nothing."""
    return np.asarray(np.cumsum(np.abs(_steps(record))))


def _steps(record: Record) -> Array:
    """Return the way from sample to sample (N,), in any unit, or nothing."""
    if 'position' in record:
        return np.asarray(np.diff(record['position'], prepend=record['position'][:1]))
    return record['speed'] if 'speed' in record else np.empty(0)
