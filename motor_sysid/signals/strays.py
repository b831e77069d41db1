"""Stray samples: one or two that lie far off between neighbours that agree.

A garbled message, a value read while it was being written, a counter that missed an edge and
caught up.  One of them may weigh as much in a sum of squares as thousands of good samples.  A
motor makes none: a speed cannot leave and come back within a sample, nor a current that no step of
the input has moved.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.channels import Role, role_of
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
Places = NDArray[np.intp]

FAR = 5.0
"""Distance of a stray sample from the line between its neighbours, in units of what one sample in
a hundred of those that move at all exceeds; white noise comes that far once in 1e50."""

ALONE = 5.0
"""The same in units of the largest step around it: where all moves fast, none is stray."""

LONGEST = 2
"""Samples in a row: one of a position makes two of a speed that is its difference."""

AROUND = 3
"""Good samples on either side that are compared with."""

FEWEST = 100
"""Samples that move at all below which nothing is told."""

MOVED = 0.1
"""Step of an input, in units of its range, after which a current may do anything."""

_WATCHED = ('speed', 'position', 'acceleration', 'current')


@dataclass(frozen=True)
class Strays:
    """Stray samples of one signal of a record.

    Attributes
    ----------
    record, name:
        Where they are.
    places:
        (K,) rows, rising.
    mended:
        (N,) the signal with these on the line between their neighbours.
    """

    record: Record
    name: str
    places: Places
    mended: Array

    @property
    def largest(self) -> float:
        """Distance of the farthest of them from where its neighbours put it."""
        off = np.abs(self.record[self.name] - self.mended)
        return float(np.max(off))

    def __str__(self) -> str:
        count, unit = len(self.places), self.record.units[self.name]
        first = self.record.time[self.places[0]]
        if count == 1:
            return f'1 sample of {self.name} is {self.largest:.4g} {unit} off at {first:.6g} s'
        return (
            f'{count} samples of {self.name} are up to {self.largest:.4g} {unit} off, the first '
            f'at {first:.6g} s'
        )


def strays_of(record: Record) -> Iterator[Strays]:
    """Yield the stray samples of each measured signal that has some."""
    for name in record:
        if name.split('_')[0] in _WATCHED and 'reference' not in name and 'command' not in name:
            values = record[name]
            quiet = _quiet(record) if name.startswith('current') else None
            places = stray_places(values, quiet)
            if places.size:
                good = np.setdiff1d(np.arange(values.size), places)
                mended = values.copy()
                mended[places] = np.interp(record.time[places], record.time[good], values[good])
                yield Strays(record, name, places, mended)


def without_strays(record: Record) -> Record:
    """Return a record with its stray samples on the line between their neighbours."""
    for found in strays_of(record):
        unit = record.units[found.name]
        record = record.with_signal(found.name, found.mended, unit)
        note = f'{found}; put between its neighbours'
        record = replace(record, provenance=record.provenance.noting(note))
    return record


def told_strays(records: Sequence[Record]) -> tuple[str, ...]:
    """Say which samples `without_strays` mends."""
    return tuple(
        f'{record.provenance.source or "a record"}: {found} between neighbours that agree: a '
        'glitch of the sensor or the bus, which no fit sees'
        for record in records
        for found in strays_of(record)
    )


def stray_places(values: Array, quiet: NDArray[np.bool_] | None = None) -> Places:
    """Return the rows of stray samples.

    Parameters
    ----------
    values:
        (N,) measured values, finite.
    quiet:
        (N,) rows that may be stray; by default all.
    """
    rows: list[Places] = []
    steps = np.abs(np.diff(values))
    off = np.abs(values[1:-1] - 0.5 * (values[:-2] + values[2:]))
    moving = off[off > 0.0]
    if moving.size < FEWEST or not np.all(np.isfinite(values)):
        return np.empty(0, dtype=np.intp)
    far = FAR * np.quantile(moving, 0.99)
    for length in range(1, LONGEST + 1):
        k = np.arange(AROUND, values.size - length - AROUND + 1)
        before, after = values[k - 1], values[k + length]
        sides = [steps[k - 1 - j] for j in range(1, AROUND)]
        sides += [steps[k + length - 1 + j] for j in range(1, AROUND)]
        around = np.max([np.abs(after - before), *sides], axis=0)
        inside = [
            np.abs(values[k + j] - before - (after - before) * (j + 1) / (length + 1))
            for j in range(length)
        ]
        lone = np.min(inside, axis=0) > np.maximum(far, ALONE * around)
        rows += [k[lone] + j for j in range(length)]
    found: Places = np.unique(np.concatenate(rows))
    return found if quiet is None else found[quiet[found]]


def _quiet(record: Record) -> NDArray[np.bool_]:
    """Return (N,) where no input has moved by much within the last samples."""
    still = np.ones(len(record), dtype=np.bool_)
    for name in record:
        if role_of(name) is not Role.INPUT:
            continue
        steps = np.abs(np.diff(record[name], prepend=record[name][0]))
        moved = np.flatnonzero(steps > MOVED * np.ptp(record[name]))
        for later in range(-1, AROUND + 1):
            still[np.clip(moved + later, 0, len(record) - 1)] = False
    return still
