"""Signals that are new less often than the record has samples."""

from collections.abc import Iterator, Sequence

from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.record import Record
from motor_sysid.signals.slow_updates import slow_signals


def check(records: Sequence[Record]) -> Iterator[Finding]:
    """Look for a period after which alone a measured signal changes."""
    for found in slow_signals(records):
        yield Finding(
            Severity.WARNING, 'slow_updates', str(found),
            'held in between, it is late by half of that in the mean, which looks like a lag of '
            'its sensor; fits and diagnoses know where updates and samples are even',
            'record it as often as the other signals',
            {'samples': found.period, 'period_s': found.seconds},
        )  # fmt: skip
