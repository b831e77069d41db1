"""Single samples that no motion explains."""

from collections.abc import Iterator, Sequence

from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.record import Record
from motor_sysid.signals.strays import strays_of


def check(records: Sequence[Record]) -> Iterator[Finding]:
    """Look for stray samples; those of a position count as its jumps."""
    for record in records:
        for found in strays_of(record):
            if found.name == 'position':
                continue
            yield Finding(
                Severity.WARNING, 'stray_samples', str(found),
                'a fit and a diagnosis put them between their neighbours; all else takes them as '
                'they are',
                'look for garbled messages, a loose wire, or an estimator of the drive that '
                'starts anew',
                {'count': len(found.places), f'largest_{record.units[found.name]}': found.largest},
            )  # fmt: skip
