"""What is not the same in all records, in figures and in words."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from motor_sysid.diagnosis.result.figures import with_unit
from motor_sysid.diagnosis.result.findings import Difference, InRecord
from motor_sysid.diagnosis.result.names import listed
from motor_sysid.diagnosis.search.by_record import Differing, INPUT, MATTERS
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
        It, with a factor for each record; NaN where records were not compared.
    records:
        All of them.
    searched:
        Numbers of those that were searched in the end; by default all.
    """
    names, kept = names_of(records), range(len(records)) if searched is None else searched
    half = 1.96 * np.hypot(one.sigmas, NOT_QUITE * (one.factors - 1.0))
    factors = tuple(
        InRecord(name, float(f), float(f - h), float(f + h), k in kept)
        for k, (name, f, h) in enumerate(zip(names, one.factors, half, strict=True))
    )
    first, *others = (each for each in factors if np.isfinite(each.factor))
    parts = listed(map(_percent, others))
    if one.name == INPUT:
        words = (
            f'The input is not as strong in all records as was recorded: against '
            f'{first.record}, it is {parts}. A supply that differs from record to record, or from '
            'what a duty cycle is reckoned with, looks like that'
        )
        return Difference(INPUT, 'strength of the input', '', 1.0, factors, words)
    p = one.model.parameters[one.name]
    words = (
        f'{one.name} ({p.description}) is not the same in all records: against {first.record} '
        f'({with_unit(p.value, p.unit, 3)}), it is {parts}. What warms, wears or is loaded '
        'otherwise looks like that, and so does what acts in some records only'
    )
    return Difference(one.name, p.description, p.unit, p.value, factors, words)


def _percent(one: InRecord) -> str:
    off, low, high = (100.0 * (x - 1.0) for x in (one.factor, one.low, one.high))
    if abs(off) < max(100.0 * MATTERS, high - off):
        return f'the same within {abs(off) + high - off:.1g} % in {one.record}'
    return f'{off:+.2g} % (95 %: {low:+.2g} to {high:+.2g} %) in {one.record}'


def names_of(records: Sequence[Record]) -> list[str]:
    """Return what records are called: their sources, or numbers where these do not tell."""
    sources = [record.provenance.source for record in records]
    if all(sources) and all(a != b for a, b in pairwise(sorted(sources))):
        return sources
    return [f'record {k + 1}' for k in range(len(records))]
