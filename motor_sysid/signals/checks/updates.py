"""Signals that are new less often than the record has samples, and are held in between."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.channels import Role, role_of
from motor_sysid.signals.checks.common import runs
from motor_sysid.signals.checks.values import SLOW
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.lattice import lattice
from motor_sysid.signals.record import Record

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

    @property
    def harm(self) -> str:
        """What comes of it."""
        return (
            'held in between, it is late by half of that in the mean, which looks like a lag of '
            'its sensor'
        )


def check(records: Sequence[Record]) -> Iterator[Finding]:
    """Look for a period after which alone a measured signal changes."""
    for found in slow_signals(records):
        yield Finding(
            Severity.WARNING, 'slow_updates', str(found), found.harm,
            'record it as often as the other signals'
            + ('' if found.about else f', or keep one sample of {found.period} of all signals'),
            {'samples': found.period, 'period_s': found.seconds},
        )  # fmt: skip


def slow_signals(records: Sequence[Record]) -> Iterator[Slow]:
    """Yield the measured signals that are new less often than the records have samples."""
    for name in dict.fromkeys(name for record in records for name in record):
        if role_of(name) is not Role.MEASURED or name in SLOW:
            continue
        having = [record for record in records if name in record]
        lengths = [found for record in having if (found := held_lengths(record, name)).size]
        periods = {period for found in lengths if (period := period_of(found)) > 1}
        if len(periods) == 1:
            (period,) = periods
            yield Slow(name, period, period * having[0].dt)
        elif lengths and not periods and is_held(np.concatenate(lengths)):
            mean = float(np.mean(np.concatenate(lengths)))
            yield Slow(name, round(mean), mean * having[0].dt, about=True)


def held_lengths(record: Record, name: str) -> NDArray[np.intp]:
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


def period_of(lengths: NDArray[np.intp]) -> int:
    """Return after how many samples a signal changes, 1 if it may in each."""
    period = int(np.bincount(lengths).argmax())
    return period if period > 1 and np.mean(lengths % period == 0) > REGULAR else 1


def is_held(lengths: NDArray[np.intp]) -> bool:
    """Tell whether a signal is new at times of its own: nearly always after about as long."""
    usual = float(np.median(lengths))
    return bool(np.mean(lengths >= max(2.0, SHORTEST * usual)) > REGULAR)
