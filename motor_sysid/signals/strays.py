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
a hundred of those that move at all exceeds; white noise comes that far once in 1e37."""

ALONE = 5.0
"""The same in units of the largest step around it: where all moves fast, none is stray."""

LONGEST = 2
"""Samples in a row: one of a position makes two of a speed that is its difference."""

AROUND = 3
"""Samples on either side that are compared with."""

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
            return (
                f'1 sample of {self.name}, at {first:.6g} s, is {self.largest:.4g} {unit} off its '
                'neighbours'
            )
        return (
            f'{count} samples of {self.name}, the first at {first:.6g} s, are up to '
            f'{self.largest:.4g} {unit} off their neighbours'
        )


def strays_of(record: Record) -> Iterator[Strays]:
    """Yield the stray samples of each measured signal that has some."""
    for name in filter(_is_watched, record):
        values = record[name]
        quiet = _quiet(record) if name.startswith('current') else None
        places = stray_places(values, quiet)
        mended = _between(record.time, values, places) if places.size else values.copy()
        ends = _stray_ends(record, name, mended)
        ends = ends if quiet is None else ends[quiet[ends]]
        if ends.size or places.size:
            mended[ends] = 2 * mended[np.abs(ends - 1)] - mended[np.abs(ends - 2)]
            yield Strays(record, name, np.union1d(places, ends), mended)


def _between(time: Array, values: Array, places: Places) -> Array:
    """Return the values, those at some places on the line between their neighbours."""
    good, mended = np.setdiff1d(np.arange(values.size), places), values.copy()
    mended[places] = np.interp(time[places], time[good], values[good])
    return mended


def without_strays(record: Record) -> Record:
    """Return a record with its stray samples on the line between their neighbours."""
    for found in strays_of(record):
        unit = record.units[found.name]
        record = record.with_signal(found.name, found.mended, unit)
        note = f'{found}; put between them'
        record = replace(record, provenance=record.provenance.noting(note))
    return record


def told_strays(records: Sequence[Record]) -> tuple[str, ...]:
    """Say which samples `without_strays` mends."""
    return tuple(
        f'{record.provenance.source or "a record"}: {found}: a glitch of the sensor or the bus, '
        'which no fit sees'
        for record in records
        for found in strays_of(record)
    )


def stray_places(values: Array, quiet: NDArray[np.bool_] | None = None) -> Places:
    """Return the rows of stray samples.

    Parameters
    ----------
    values:
        (N,) measured values.
    quiet:
        (N,) rows that may be stray; by default all.

    Returns
    -------
    (K,) rows, rising; none of values that are not finite or hardly move.
    """
    rows: list[Places] = []
    if not np.all(np.isfinite(values)):
        return np.empty(0, dtype=np.intp)
    off = np.abs(values[1:-1] - 0.5 * (values[:-2] + values[2:]))
    if np.sum(off > 0.0) < FEWEST:
        return np.empty(0, dtype=np.intp)
    far = FAR * _usual(off)
    bare = np.abs(np.diff(values))
    steps, away = np.pad(bare, AROUND), np.flatnonzero(bare > (1 - 1 / ALONE) * far) + 1
    for length in range(1, LONGEST + 1):
        k = away[away < values.size - length]  # nothing else can be that far from the line
        before, after = values[k - 1], values[k + length]
        sides = [steps[AROUND + k - 1 - j] for j in range(1, AROUND)]
        sides += [steps[AROUND + k + length - 1 + j] for j in range(1, AROUND)]
        around = np.max([np.abs(after - before), *sides], axis=0)
        inside = [
            np.abs(values[k + j] - before - (after - before) * (j + 1) / (length + 1))
            for j in range(length)
        ]
        lone = np.min(inside, axis=0) > np.maximum(far, ALONE * around)
        rows += [k[lone] + j for j in range(length)]
    found: Places = np.unique(np.concatenate(rows))
    return found if quiet is None else found[quiet[found]]


def _usual(off: Array) -> float:
    """Return what one sample in a hundred of those that move at all exceeds.

    A stray sample is off, and so are its neighbours, whose line it bends; it counts once.
    """
    moving = off[off > 0.0]
    large = off > FAR * np.quantile(moving, 0.9)
    edges = np.flatnonzero(np.diff(np.pad(large.astype(np.int8), 1)))
    starts, stops = edges[::2], edges[1::2]
    short = stops - starts <= LONGEST + 2
    if not np.any(short):
        return float(np.quantile(moving, 0.99))
    tops = np.maximum.reduceat(np.append(off, 0.0), edges)[::2][short]
    lone = np.zeros(off.size + 1, dtype=np.int8)
    np.add.at(lone, starts[short], 1)
    np.add.at(lone, stops[short], -1)
    rest = off[(np.cumsum(lone)[:-1] == 0) & (off > 0.0)]
    return float(np.quantile(np.concatenate([rest, tops]), 0.99))


def _stray_ends(record: Record, name: str, values: Array) -> Places:
    """Return the first and the last row, where they are stray.

    They have a neighbour on one side only.  So the line through the next samples must miss them by
    far, and the step to or from them must be none that the record's own signals lead to from one
    sample to the next: a motor at rest may be fast after one long sample.
    """
    far = [
        (place, step)
        for place, way, step in ((0, values, 0), (values.size - 1, values[::-1], -1))
        if values.size >= 2 * FEWEST
        and abs(way[0] - 2 * way[1] + way[2])
        > ALONE * np.max(np.abs(np.diff(way[1 : AROUND + 2])))
    ]
    if not far:
        return np.empty(0, dtype=np.intp)
    told = [n for n in record if n == name or role_of(n) is Role.INPUT or _is_watched(n)]
    columns = [values if n == name else record[n] for n in told]
    x = np.column_stack([*columns, np.ones(values.size)])[:-1]
    if not np.all(np.isfinite(x)):
        return np.empty(0, dtype=np.intp)
    size = np.maximum(np.max(np.abs(x), axis=0), 1e-300)
    inside = slice(AROUND, -AROUND)
    lead, *_ = np.linalg.lstsq((x / size)[inside], values[1:][inside], rcond=None)
    missed = np.abs(values[1:] - (x / size) @ lead)
    usual = FAR * np.quantile(missed[inside], 0.99)
    return np.array([place for place, step in far if missed[step] > usual], dtype=np.intp)


def _is_watched(name: str) -> bool:
    return name.split('_')[0] in _WATCHED and not name.endswith(('reference', 'command'))


def _quiet(record: Record) -> NDArray[np.bool_]:
    """Return (N,) where no input has moved by much within the last samples, and no sector begun.

    An input that is there from the first sample on was switched on then.
    """
    still = np.ones(len(record), dtype=np.bool_)
    for name in record:
        if role_of(name) is Role.INPUT:
            steps = np.abs(np.diff(record[name], prepend=0.0))
        elif name == 'hall_sector':
            steps = np.abs(np.diff(record[name], prepend=record[name][:1]))
        else:
            continue
        moved = np.flatnonzero(steps > MOVED * np.ptp(record[name]))
        for later in range(-1, AROUND + 1):
            still[np.clip(moved + later, 0, len(record) - 1)] = False
    return still
