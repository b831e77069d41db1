"""Signals that are not new in every row of a record: held in between, or sampled by themselves.

Held in between, a signal is late by half of that in the mean, which looks like a lag of its
sensor.  Where that comes at even times, or where it is known when a signal was sampled, a fit
compares it with what the model shows at the time of its last news.  A speed that is new at times
of its own that nobody recorded may be what its sensor made of the time since.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from motor_sysid.signals.channels import Role, role_of, SLOW
from motor_sysid.signals.held import runs
from motor_sysid.signals.lattice import lattice
from motor_sysid.signals.record import Record, Samples

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

FEWEST = 50
"""Changes of a signal below which nothing is told."""

REGULAR = 0.9
"""Share of the changes that must be whole periods apart."""

SHORTEST = 0.6
"""Length in units of the usual one below which a value is not held as long as others."""

COUNT = 1.5
"""Change in units of a counter's step below which it counts a slow motion, however regular."""


@dataclass(frozen=True)
class Slow:
    """A signal that is new in one sample of `period` only, every `seconds`.

    Or, where that is only `about` so, at times of its own, after as many in the mean.
    """

    name: str
    period: int
    seconds: float
    about: bool = False

    def __str__(self) -> str:
        return (
            f'{self.name} is new in {"about " if self.about else ""}one sample of {self.period} '
            f'only, every {1e3 * self.seconds:.4g} ms'
        )


def slow_signals(records: Sequence[Record]) -> Iterator[Slow]:
    """Yield the measured signals that are new less often than the records have samples."""
    for name in dict.fromkeys(name for record in records for name in record):
        if role_of(name) is not Role.MEASURED or name in SLOW:
            continue
        having = [record for record in records if name in record and name not in record.samples]
        lengths = [found for record in having if (found := held_lengths(record, name)).size]
        periods = {period for found in lengths if (period := period_of(found)) > 1}
        if len(periods) == 1:
            (period,) = periods
            yield Slow(name, period, period * having[0].dt)
        elif lengths and not periods and is_held(np.concatenate(lengths)):
            mean = float(np.mean(np.concatenate(lengths)))
            yield Slow(name, round(mean), mean * having[0].dt, about=True)


def held_lengths(record: Record, name: str) -> Rows:
    """Return for how many samples each value of a signal is held; nothing if that tells nothing.

    That is so where it seldom changes, and where it counts a slow motion.
    """
    values = record[name]
    starts, lengths = runs(values)
    inside = lengths[1:-1]
    if inside.size < FEWEST:
        return inside[:0]
    found, changes = lattice(values), np.abs(np.diff(values[starts]))
    return inside[:0] if found and np.median(changes) < COUNT * found.step else inside


def period_of(lengths: Rows) -> int:
    """Return after how many samples a signal changes, 1 if it may in each."""
    period = int(np.bincount(lengths).argmax())
    return period if period > 1 and np.mean(lengths % period == 0) > REGULAR else 1


def is_held(lengths: Rows) -> bool:
    """Tell whether a signal is new at times of its own: nearly always after about as long."""
    usual = float(np.median(lengths))
    return bool(np.mean(lengths >= max(2.0, SHORTEST * usual)) > REGULAR)


def periods_of(records: Sequence[Record]) -> dict[str, int]:
    """Return for how many samples measured signals are held, of those that are so for as many."""
    return {one.name: one.period for one in slow_signals(records) if not one.about}


def news_of(record: Record, name: str, period: int) -> Rows | None:
    """Return the rows in which a measured signal that is held is new, (M,), the first included.

    Parameters
    ----------
    record:
        Evenly sampled record.
    period:
        For how many samples the signal is held; with 1 it is new in every row, and nothing is
        returned.
    """
    if role_of(name) is not Role.MEASURED or period == 1:
        return None
    starts, _ = runs(record[name])
    new = np.zeros(len(record), dtype=np.bool_)
    new[starts] = True
    if starts.size > 1:
        new[np.bincount(starts[1:] % period).argmax() :: period] = True
    return np.flatnonzero(new)


def with_news_held(record: Record, driving: Collection[str] = ()) -> Record:
    """Return a record in which what was sampled at times of its own is held until its next news.

    A position beside a speed moves on from news to news; so does what is `driving` the motor, and
    what is slow by nature.
    """
    held = {
        name: own.values[shown_in(record, own)]
        for name, own in record.samples.items()
        if _is_compared(name, record) and name not in driving
    }
    moving = with_news_between(record)
    return replace(moving, signals={**moving.signals, **held}) if held else moving


def _is_compared(name: str, record: Record) -> bool:
    """Tell whether a fit may compare a signal with a model."""
    return name not in SLOW and (name != 'position' or 'speed' not in record)


def with_news_between(record: Record) -> Record:
    """Return a record in which what was sampled at times of its own moves on in between.

    A position moves on smoothly, as inertia has it, and all else straight.
    """
    moving = {
        name: (_smooth if name == 'position' else np.interp)(record.time, own.time, own.values)
        for name, own in record.samples.items()
    }
    return replace(record, signals={**record.signals, **moving}) if moving else record


def _smooth(time: Array, known: Array, values: Array) -> Array:
    """Return values (N,) at times between those that are known, on a cubic spline.

    Halfway between samples a straight line is off by ``a T^2 / 8`` where the motor accelerates by
    `a` for their period `T`, which is much of a wave where a turn has many.
    """
    if known.size < FEWEST:
        return np.asarray(np.interp(time, known, values))
    spline = CubicSpline(known, values)
    return np.asarray(spline(np.clip(time, known[0], known[-1])))


def shown_in(record: Record, own: Samples) -> Rows:
    """Return for each row the last of a signal's own samples up to then, (N,)."""
    return np.clip(np.searchsorted(own.time, record.time, side='right') - 1, 0, None)


def told_slow(records: Sequence[Record]) -> tuple[str, ...]:
    """Say which signals of records as they were measured are held, and what a fit makes of it."""
    even = all(record.is_uniform for record in records)
    sampled = dict.fromkeys(n for r in records for n in r.samples if _is_compared(n, r))
    known, not_known = 'a fit compares it with the model as it was then', (
        'held in between, it is late by half of that in the mean, which looks like a lag of its '
        'sensor'
    )
    return (
        *(f'{name} was sampled at times of its own: {known}' for name in sampled),
        *(
            f'{one}: {known if even and not one.about else not_known}'
            for one in slow_signals(records)
        ),
    )


def with_moving_positions(records: Sequence[Record]) -> list[Record]:
    """Return records whose positions, where they are held, move on smoothly from news to news.

    Those beside a speed, that is: without one a fit compares what is held.
    """
    period = periods_of(records).get('position', 1)
    return [_with_moving_position(r, period) if 'speed' in r else r for r in records]


def _with_moving_position(record: Record, period: int) -> Record:
    rows = news_of(record, 'position', period) if 'position' in record else None
    if rows is None or 'position' in record.samples:
        return record
    values = record['position']
    moving = _smooth(record.time, record.time[rows], values[rows])
    return record.with_signal('position', moving, record.units['position'])
