"""Records whose supply or resistance is not the same: what is missing beside that.

Where a search leaves something unknown, or names what is less certain than that, records are
brought to a common supply and resistance and searched again.  What is found then counts if it
leaves nothing unknown.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.figures import with_unit
from motor_sysid.diagnosis.result.names import listed
from motor_sysid.diagnosis.result.result import Diagnosis, Verdict
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.by_record import Differing, differing, INPUT
from motor_sysid.estimation.batch import make_chain, sensors_of
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

RESISTANCE = 'R'
ROUNDS = 6
"""Most steps to a common supply and resistance."""
FINE = 4
"""Integration steps per sample, at least: in coarse ones a narrow sign looks like another
inductance wherever the motor moves otherwise."""
NOT_QUITE = 0.02
"""Standard error of a difference as a share of it, at least: the mean current of a row is taken to
be that of its ends, and differences are found one after the other."""
NEARER = 0.8
"""Held-out error with an effect that was not named, in units of that without it, up to which what
differs between records is looked for beside that effect."""
MUCH = 0.2
"""Share of the squared error from which on a difference is told that the search cannot use."""

Again = Callable[[Sequence[Record], Sequence[Record]], Diagnosis]
"""Searches training and validation records."""


@dataclass(frozen=True)
class Own:
    """Records brought to a common supply and resistance.

    Attributes
    ----------
    records:
        The records, with other inputs.
    differences:
        By what they differed, one for each name.
    open:
        What else differs and is in no input; None if nothing does.
    """

    records: tuple[Record, ...]
    differences: tuple[Differing, ...]
    open: Differing | None


def with_own_values(
    found: Diagnosis, bench: Bench, train: Sequence[Record], validation: Sequence[Record],
    again: Again, tell: Callable[[str], None],
) -> Diagnosis:  # fmt: skip
    """Return what was found, or what is found where every record has its own supply.

    Parameters
    ----------
    found, bench:
        A diagnosis, and on what.
    train, validation:
        Its records, prepared.
    again:
        Searches others.
    tell:
        Is told what is going on.
    """
    records = [*train, *validation]
    if len(records) < 2 or found.verdict in (Verdict.COMPLETE, Verdict.INSUFFICIENT_DATA):
        return found
    own = brought_together(_nearest(found), bench, records)
    told = (*own.differences, *([own.open] if own.open else []))
    if not told or not _is_asked(found, told):
        return found
    if own.differences:
        tell('records differ in their supply or resistance: looking once more without that')
        other = again(own.records[: len(train)], own.records[len(train) :])
        if not other.unknown and other.verdict is not Verdict.INSUFFICIENT_DATA:
            return _told(other, own.differences, records)
    share = max(one.share for one in told)
    if not (found.unknown or found.verdict is Verdict.UNKNOWN_EFFECT) or share < MUCH:
        return found
    return _with(found, tuple(in_words(one, records) for one in told))


def _nearest(found: Diagnosis) -> Model:
    """Return the model that is nearest to the data: that of an effect not named, if that is."""
    last = found.steps[-1]
    some = [one for one in last.candidates if one.model and one.validation_error_percent > 0]
    best = min(some, key=lambda one: one.validation_error_percent, default=None)
    if best is None or best.validation_error_percent > NEARER * last.validation_error_percent:
        return found.model
    return best.model or found.model


def brought_together(model: Model, bench: Bench, records: Sequence[Record]) -> Own:
    """Return records whose inputs are what they would be with the first one's supply."""
    now, differences = tuple(records), dict[str, Differing]()
    sensors = sensors_of(records, bench.kind)
    for _ in range(ROUNDS):
        chains = [
            make_chain(r, bench.kind, bench.outputs, horizon=bench.horizon, sensors=sensors)
            for r in now
        ]
        one = differing(model, chains, bench.outputs, max(bench.substeps, FINE))
        if one is None or not one.matters:
            return Own(now, tuple(differences.values()), None)
        changed = _corrected(now, one, bench)
        if changed is None:
            return Own(now, tuple(differences.values()), one)
        now, model = changed, one.model
        before = differences.get(one.name)
        if before is not None:
            one = replace(before, factors=before.factors * one.factors, model=one.model)
        differences[one.name] = one
    return Own(now, tuple(differences.values()), None)


def _corrected(
    records: Sequence[Record], one: Differing, bench: Bench
) -> tuple[Record, ...] | None:
    """Return records with inputs that make up for a difference; None if no inputs can."""
    factors = one.factors.tolist()
    pairs = list(zip(records, factors, strict=True))
    if one.name == INPUT:
        return tuple(_scaled(r, input_signals(r, bench.kind), factor) for r, factor in pairs)
    if one.name != RESISTANCE or not all(_currents(r, bench) for r in records):
        return None
    resistance = one.model[RESISTANCE]
    return tuple(_without_drop(r, bench, resistance * (factor - 1.0)) for r, factor in pairs)


def _currents(record: Record, bench: Bench) -> dict[str, str]:
    """Return the current that each voltage of a record drives; nothing if one is not measured."""
    voltages = [name for name in input_signals(record, bench.kind) if name.startswith('voltage')]
    found = {name: name.replace('voltage', 'current') for name in voltages}
    return found if found and all(name in record for name in found.values()) else {}


def _scaled(record: Record, names: Sequence[str], factor: float) -> Record:
    for name in names:
        record = record.with_signal(name, factor * record[name], record.units[name])
    return record


def _without_drop(record: Record, bench: Bench, more: float) -> Record:
    """Return a record without the voltage that `more` ohm take, in the middle of each row."""
    for voltage, current in _currents(record, bench).items():
        amperes = record[current]
        middle = np.append(0.5 * (amperes[:-1] + amperes[1:]), amperes[-1:])
        record = record.with_signal(voltage, record[voltage] - more * middle, 'V')
    return record


def _is_asked(found: Diagnosis, told: Sequence[Differing]) -> bool:
    """Whether something unknown is left, or what is named is less certain than a difference."""
    if found.unknown or found.verdict is Verdict.UNKNOWN_EFFECT:
        return True
    weakest = min((one.delta_bic for one in found.evidence), default=np.inf)
    return max(one.delta_bic for one in told) > weakest


def _told(
    found: Diagnosis, differences: Sequence[Differing], records: Sequence[Record]
) -> Diagnosis:
    """Return a diagnosis of records brought together, and say so."""
    words = tuple(in_words(one, records) for one in differences)
    if found.verdict is not Verdict.COMPLETE:
        verdict, *others = found.reasons
        rest = 'Searched, and shown, with inputs that make up for that'
        return replace(found, reasons=(verdict, *words, rest, *others))
    rest = (
        'No effect of the catalogue is missing beside that: with inputs that make up for it, as '
        'shown here, what is left is sensor noise'
    )
    reasons = (*words, rest, *found.reasons[1:])
    return replace(found, verdict=Verdict.UNKNOWN_EFFECT, reasons=reasons)


def _with(found: Diagnosis, words: tuple[str, ...]) -> Diagnosis:
    verdict, *others = found.reasons
    return replace(found, reasons=(verdict, *words, *others))


def in_words(one: Differing, records: Sequence[Record]) -> str:
    """Say what differs from record to record, and by how much."""
    names = _names(records)
    percent = [100.0 * (factor - 1.0) for factor in one.factors]
    errors = 196.0 * np.hypot(one.sigmas, NOT_QUITE * (one.factors - 1.0))
    parts = listed(
        f'{p:+.2g} % (95 %: {p - e:+.2g} to {p + e:+.2g} %) in {name}'
        for p, e, name in list(zip(percent, errors, names, strict=True))[1:]
    )
    if one.name == INPUT:
        return (
            f'The input is not as strong in all records as was recorded: against {names[0]}, it '
            f'is {parts}. A supply that differs from record to record, or from what a duty cycle '
            'is reckoned with, looks like that'
        )
    p = one.model.parameters[one.name]
    return (
        f'{one.name} ({p.description}) is not the same in all records: against {names[0]} '
        f'({with_unit(p.value, p.unit, 3)}), it is {parts}. What warms, wears or is loaded '
        'otherwise looks like that'
    )


def _names(records: Sequence[Record]) -> list[str]:
    sources = [record.provenance.source for record in records]
    if all(sources) and all(a != b for a, b in pairwise(sorted(sources))):
        return sources
    return [f'record {k + 1}' for k in range(len(records))]
