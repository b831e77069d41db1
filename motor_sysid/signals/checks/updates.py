"""Signals that are new less often than the record has samples, and are held in between."""

from collections.abc import Iterator, Sequence

import numpy as np

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

COUNT = 1.5
"""Change in units of a counter's step below which it counts a slow motion, however regular."""


def check(records: Sequence[Record]) -> Iterator[Finding]:
    """Look for a period after which alone a measured signal changes."""
    for name in dict.fromkeys(name for record in records for name in record):
        if role_of(name) is not Role.MEASURED or name in SLOW:
            continue
        having = [record for record in records if name in record]
        periods = {period_of(record, name) for record in having}
        if len(periods) > 1 or periods == {1}:
            continue
        (period,), dt = periods, having[0].dt
        yield Finding(
            Severity.WARNING, 'slow_updates',
            f'{name} is new in one sample of {period} only, every {1e3 * period * dt:.4g} ms',
            'held in between, it is late by half of that in the mean, which looks like a lag of '
            'its sensor',
            f'record it as often as the other signals, or take every {period}th sample of all',
            {'samples': period, 'period_s': period * dt},
        )  # fmt: skip


def period_of(record: Record, name: str) -> int:
    """Return after how many samples a signal changes, 1 if it may in each."""
    values = record[name]
    starts, lengths = runs(values)
    inside = lengths[1:-1]
    if inside.size < FEWEST:
        return 1
    found, changes = lattice(values), np.abs(np.diff(values[starts]))
    if found and np.median(changes) < COUNT * found.step:
        return 1
    period = int(np.bincount(inside).argmax())
    return period if period > 1 and np.mean(inside % period == 0) > REGULAR else 1
