"""What is not the same in all records, in figures and in words."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from motor_sysid.diagnosis.result.figures import with_unit
from motor_sysid.diagnosis.result.findings import Difference, InRecord
from motor_sysid.diagnosis.result.names import listed
from motor_sysid.diagnosis.search.by_record import Differing, MATTERS
from motor_sysid.diagnosis.search.may_differ import INPUT, shown_by, with_own
from motor_sysid.signals.record import Record

NOT_QUITE = 0.02
"""Standard error of a difference as a share of it, at least: the mean current of a row is taken to
be that of its ends, and differences are found one after the other."""


def difference_of(
    one: Differing, records: Sequence[Record], searched: Sequence[int] | None = None
) -> Difference:
    """Return what differs between records, and by how much.

    Parameters
    ----------
    one:
        It, with a value for each record; NaN where records were not compared.
    records:
        All of them.
    searched:
        Numbers of those that were searched in the end; by default all.
    """
    names, kept = names_of(records), range(len(records)) if searched is None else searched
    known = np.flatnonzero(np.isfinite(one.values))
    half = 1.96 * np.hypot(one.sigmas, NOT_QUITE * (one.values - one.values[known[0]]))
    values = tuple(
        InRecord(name, float(v), float(v - h), float(v + h), k in kept)
        for k, (name, v, h) in enumerate(zip(names, one.values, half, strict=True))
    )
    first, *others = (values[k] for k in known)
    if one.name == INPUT:
        parts = listed(_percent(each, first) for each in others)
        words = (
            f'The input is not as strong in all records as was recorded: against '
            f'{first.record}, it is {parts}. A supply that differs from record to record, or from '
            'what a duty cycle is reckoned with, looks like that'
        )
        return Difference(INPUT, 'strength of the input', '1', values, words)
    p = with_own(one.model, one.name, None).parameters[one.name]
    if one.relative:
        parts = listed(_percent(each, first) for each in others)
        found = f'against {first.record} ({with_unit(first.value, p.unit, 3)}), it is {parts}'
    else:
        parts = listed(_amount(each, first, p.unit, one.least) for each in others)
        found = f'it is {_size(first.value, p.unit, one.least)} in {first.record}, {parts}'
    sensor = shown_by(one.name, one.model.kind)
    why = (
        'A sensor that is set to zero anew for each record looks like that' if sensor
        else 'What warms, wears or is loaded otherwise looks like that, and so does what acts in '
        'some records only'
    )  # fmt: skip
    words = f'{one.name} ({p.description}) is not the same in all records: {found}. {why}'
    return Difference(one.name, p.description, p.unit, values, words)


def _percent(one: InRecord, first: InRecord) -> str:
    off, low, high = (100.0 * (x / first.value - 1.0) for x in (one.value, one.low, one.high))
    if abs(off) < max(100.0 * MATTERS, high - off):
        return f'the same within {abs(off) + high - off:.1g} % in {one.record}'
    return f'{off:+.2g} % (95 %: {low:+.2g} to {high:+.2g} %) in {one.record}'


def _amount(one: InRecord, first: InRecord, unit: str, least: float) -> str:
    off, half = abs(one.value - first.value), one.high - one.value
    if off < max(least, half):
        return f'the same within {with_unit(off + half, unit, 2)} in {one.record}'
    low, high = with_unit(one.low, unit, 3), with_unit(one.high, unit, 3)
    return f'{_size(one.value, unit, least)} (95 %: {low} to {high}) in {one.record}'


def _size(value: float, unit: str, least: float) -> str:
    return 'next to nothing' if abs(value) < least else with_unit(value, unit, 3)


def names_of(records: Sequence[Record]) -> list[str]:
    """Return what records are called: their sources, or numbers where these do not tell."""
    sources = [record.provenance.source for record in records]
    if all(sources) and all(a != b for a, b in pairwise(sorted(sources))):
        return sources
    return [f'record {k + 1}' for k in range(len(records))]
