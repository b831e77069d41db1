"""Records that are not of one motor and supply: what is missing beside that.

Where a search leaves something unknown, or names what is less certain than that, records are
brought to a common supply, resistance and zero of the sensors, and searched again; or, where an
inertia, a load or a friction differs, those of them in which it does not.  What is found then
counts if it leaves nothing unknown, and describes the records that were left out with a value of
their own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.names import listed
from motor_sysid.diagnosis.result.result import Candidate, Diagnosis, Step, Verdict
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.by_record import Differing, differing, measured_by
from motor_sysid.diagnosis.search.may_differ import INPUT, shown_by
from motor_sysid.diagnosis.search.refusals import MIN_SAMPLES
from motor_sysid.diagnosis.verdict.between_records import difference_of, names_of
from motor_sysid.diagnosis.where.uneven_records import UNEVEN
from motor_sysid.estimation.batch import Chain, make_chain, sensors_of
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

RESISTANCE = 'R'
ROUNDS = 6
"""Most steps to a common supply, resistance and zero."""
FINE = 4
"""Integration steps per sample, at least: in coarse ones a narrow sign looks like another
inductance wherever the motor moves otherwise."""
NEARER = 0.8
"""Errors with an effect that was not named, in units of those without it, up to which what differs
between records is looked for beside that effect."""
SAME = 2.0
"""Difference up to which a value counts as the same in two records, in units of that which is
worth telling, ..."""
STEP = 0.15
"""... or, if that is more, as a share of the largest difference between any: values are those of
one step of Gauss and Newton, which is that far off where a value differs by much."""
MUCH = 0.2
"""Share of the squared error that must go with what nothing makes up for."""

Again = Callable[[Sequence[Record], Sequence[Record]], Diagnosis]
"""Searches training and validation records."""


@dataclass(frozen=True)
class Own:
    """Records brought to a common supply and zero, without those that differ otherwise.

    Attributes
    ----------
    records:
        All records, with other inputs and outputs.
    kept:
        Numbers of those that are left.
    differences:
        By what they differed, one for each name.
    left_out:
        What differs that nothing of that makes up for; None if nothing does.
    """

    records: tuple[Record, ...]
    kept: tuple[int, ...]
    differences: tuple[Differing, ...] = ()
    left_out: Differing | None = None

    @property
    def told(self) -> tuple[Differing, ...]:
        """All that is to be said of the records."""
        return (*self.differences, *([self.left_out] if self.left_out else []))

    def among(self, first: int, last: int) -> list[Record]:
        """Return the records that are left of numbers first to last (exclusive)."""
        return [self.records[k] for k in self.kept if first <= k < last]

    @property
    def is_all(self) -> bool:
        """Whether a value of its own is all that records that were left out ask for."""
        if self.left_out is None:
            return True
        out = [k for k in range(len(self.records)) if k not in self.kept]
        left = self.left_out.left
        return bool(np.all(left[out] < UNEVEN * np.max(left[list(self.kept)], axis=0)))

    def as_told_by(self, model: Model, bench: Bench) -> 'Own':
        """Return the same, with what was left out measured by a model that fits the others."""
        if self.left_out is None:
            return self
        chains, steps = whole_chains(self.records, bench), max(bench.substeps, FINE)
        measured = measured_by(
            self.left_out, model, chains, bench.outputs, steps, bench.scales
        )
        return replace(self, left_out=measured)


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
    own = brought_together(nearest(found), bench, records)
    if not own.told or not _is_asked(found, own.told):
        return found
    fitted, judged = own.among(0, len(train)), own.among(len(train), len(records))
    if fitted and sum(map(len, fitted)) >= MIN_SAMPLES:
        tell('records are not of one motor and supply: looking once more without that')
        other = again(fitted, judged)
        measured = own.as_told_by(other.model, bench)
        enough = other.verdict is not Verdict.INSUFFICIENT_DATA and measured.is_all
        if enough and not other.unknown:
            return _told(other, measured)
    share = max(one.share for one in own.told)
    if not (found.unknown or found.verdict is Verdict.UNKNOWN_EFFECT) or share < MUCH:
        return found
    verdict, *others = found.reasons
    differences = tuple(difference_of(one, records) for one in own.told)
    words = (one.words for one in differences)
    return replace(found, reasons=(verdict, *words, *others), differences=differences)


def nearest(found: Diagnosis) -> Model:
    """Return the model that is nearest to the data: that of an effect not named, if that is."""
    last = found.steps[-1]
    some = [one for one in last.candidates if one.model and _errors(one) > 0]
    best = min(some, key=_errors, default=None)
    if best is None or _errors(best) > NEARER * _errors(last):
        return found.model
    return best.model or found.model


def _errors(one: Step | Candidate) -> float:
    """Return the product of the errors over training and held-out data.

    Where records differ the held-out ones alone may refuse what is missing in all of them.
    """
    return one.train_error_percent * one.validation_error_percent


def brought_together(model: Model, bench: Bench, records: Sequence[Record]) -> Own:
    """Return records whose signals are what they would be with the first one's supply and zeros.

    Of records that differ by what nothing makes up for, the largest part that does not is left.
    """
    own = Own(tuple(records), tuple(range(len(records))))
    for _ in range(ROUNDS):
        chains = whole_chains(own.among(0, len(records)), bench)
        one = differing(
            model, chains, bench.outputs, max(bench.substeps, FINE), bench.scales
        )
        if one is None or not one.matters:
            break
        changed, model = _without(own, one, bench), one.model
        if changed is None:
            break
        own = changed
    return own


def _without(own: Own, one: Differing, bench: Bench) -> Own | None:
    """Return the records without a difference between those that are left; None if it stays."""
    those = own.among(0, len(own.records))
    values = np.full(len(own.records), np.nan)
    sigmas = values.copy()
    values[list(own.kept)], sigmas[list(own.kept)] = one.values, one.sigmas
    told = replace(one, values=values, sigmas=sigmas)
    changed = _corrected(those, one, bench)
    if changed is not None:
        new = dict(zip(own.kept, changed, strict=True))
        whole = tuple(new.get(k, record) for k, record in enumerate(own.records))
        return replace(own, records=whole, differences=_joined(own.differences, told))
    alike = _alike(those, one)
    if own.left_out is not None or one.share < MUCH or all(alike):
        return None
    kept = tuple(k for k, like in zip(own.kept, alike, strict=True) if like)
    return replace(own, kept=kept, left_out=told)


def whole_chains(records: Sequence[Record], bench: Bench) -> list[Chain]:
    """Return the whole of each record, cut as the bench's data are."""
    sensors = sensors_of(records, bench.kind)
    return [
        make_chain(r, bench.kind, bench.outputs, horizon=bench.horizon, sensors=sensors)
        for r in records
    ]


def _joined(before: Sequence[Differing], one: Differing) -> tuple[Differing, ...]:
    """Return differences with one more, or with a further step of one of them."""
    old = next((other for other in before if other.name == one.name), None)
    if old is None:
        return (*before, one)
    known = np.isfinite(one.values)
    first = one.values[known][0]
    further = one.values / first if one.relative else one.values - first
    both = old.values * further if one.relative else old.values + further
    joined = replace(old, values=np.where(known, both, old.values), model=one.model)
    return tuple(joined if other is old else other for other in before)


def _alike(records: Sequence[Record], one: Differing) -> list[bool]:
    """Tell which records a parameter is the same in, as many rows as there are."""
    most = max(SAME * one.least, STEP * float(np.ptp(one.values)))
    near = np.abs(one.values[:, np.newaxis] - one.values) < most
    rows = near @ np.array([len(record) for record in records])
    alike: list[bool] = near[int(np.argmax(rows))].tolist()
    return alike


def _corrected(
    records: Sequence[Record], one: Differing, bench: Bench
) -> tuple[Record, ...] | None:
    """Return records whose inputs or sensors make up for a difference; None if none can."""
    signal = shown_by(one.name, bench.kind)
    if signal and all(signal in record for record in records):
        off = (one.values - one.values[0]).tolist()
        return tuple(r.shifted(signal, -by) for r, by in zip(records, off, strict=True))
    if not one.relative:
        return None
    pairs = list(zip(records, (one.values / one.values[0]).tolist(), strict=True))
    if one.name == INPUT:
        return tuple(_scaled(r, input_signals(r, bench.kind), factor) for r, factor in pairs)
    if one.name != RESISTANCE or not all(_currents(r, bench) for r in records):
        return None
    resistance = one.values[0]
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


def _told(found: Diagnosis, own: Own) -> Diagnosis:
    """Return a diagnosis of records brought together, and say so."""
    differences = tuple(difference_of(one, own.records, own.kept) for one in own.told)
    words = [one.words for one in differences]
    found = replace(found, differences=differences)
    names = names_of(own.records)
    shown = listed(names[k] for k in own.kept)
    how = (f'over {shown} alone',) * (len(own.kept) < len(own.records))
    how += ('with signals that make up for that',) * bool(own.differences)
    if found.verdict is not Verdict.COMPLETE:
        verdict, *others = found.reasons
        return replace(
            found, reasons=(verdict, *words, f'Searched, and shown, {listed(how)}', *others)
        )
    rest = (
        f'No effect of the catalogue is missing beside that: what is left is sensor noise, '
        f'{listed(how)}, as shown here'
    )
    reasons = (*words, rest, *found.reasons[1:])
    return replace(found, verdict=Verdict.UNKNOWN_EFFECT, reasons=reasons)
