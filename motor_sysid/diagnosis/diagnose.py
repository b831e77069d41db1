"""Find out which physical effect a motor model lacks."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from motor_sysid.diagnosis.calibration.calibration import threshold_for
from motor_sysid.diagnosis.calibration.situation import situation_of
from motor_sysid.diagnosis.early_input import with_early_input
from motor_sysid.diagnosis.engine import Engine, Progress
from motor_sysid.diagnosis.lending import better_with_half_lent, shows_only_there
from motor_sysid.diagnosis.odd_record import without_odd_record
from motor_sysid.diagnosis.own_values import with_own_values
from motor_sysid.diagnosis.result.names import listed
from motor_sysid.diagnosis.result.result import Diagnosis, Verdict
from motor_sysid.diagnosis.result.threshold import Threshold
from motor_sysid.diagnosis.search.bench import (
    base_fit,
    Bench,
    make_bench,
    with_scales,
)
from motor_sysid.diagnosis.search.ready import ready
from motor_sysid.diagnosis.search.refusals import refuse_short
from motor_sysid.diagnosis.search.rung import climb
from motor_sysid.diagnosis.search.standstill import stands_still
from motor_sysid.diagnosis.settings import Settings
from motor_sysid.diagnosis.verdict.at_rest import diagnosis_at_rest
from motor_sysid.effort import counted_by
from motor_sysid.errors import UserError
from motor_sysid.estimation.batch import Chain, Weighting
from motor_sysid.physics.effect import Effect
from motor_sysid.physics.effects import catalogue, effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.checks import timing
from motor_sysid.signals.doctor import examine
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.record import Record

_REACHING = ('speed', 'current', 'current_q', 'voltage', 'voltage_q', 'torque', 'force')

FURTHER = 1.5
"""How many times larger signals of held-out records must be, so that this is told."""

CUT = (
    'the search came to an end before every way was tried: `--effort 4` looks four times as long'
)


def diagnose(
    train: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    motor: str | None = None,
    model: Model | None = None,
    nominal: Mapping[str, float] | None = None,
    effects: Sequence[str] | None = None,
    settings: Settings | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find out which physical effect a motor model lacks.

    Parameters
    ----------
    train, validation:
        Records; without validation records the last part of each training record is held back.
        Where only held-out data show what is missing, half of them are fitted as well; records
        whose supply, resistance or zero of a sensor differs are brought to the first one's, and
        those that differ otherwise are left out, if that explains what is left; and so is one
        that is not like the others.  The diagnosis says so, and holds the records as they were
        searched.
    motor:
        Motor kind; by default the richest that the signals allow.
    model:
        Model to start from; by default the linear model of the motor kind, fitted.
    nominal:
        Data-sheet values to start from as well: parameter name to value in SI.
    effects:
        Candidates; by default the whole catalogue.
    settings, progress:
        Limits; and a function that is told what is going on.

    Raises
    ------
    UserError
        If the records cannot be used at all: no input, no output, or too few samples; or if there
        is no such motor or effect.
    """
    settings = settings or Settings()
    candidates = [effect(key) for key in effects] if effects else list(catalogue().values())
    tell = progress or (lambda text: None)
    records, held, kind, nominal, notes = ready(train, validation, model, motor, nominal or {})
    refuse_short(records, held)
    bench = make_bench(records, held, kind, model, settings.validation_fraction, nominal)
    notes += bench.notes
    tell(f'fitting a linear {kind.title}')
    noise = None
    if model is None:
        fitted = base_fit(records, kind, bench.train, bench.outputs, nominal)
        model, noise = fitted.model, fitted.weighting
    notes += _passed_over(effects or (), model)
    if kind.currents and stands_still([*records, *held]):
        found = diagnosis_at_rest(climb(model, bench, noise), bench)
        searched = tuple(records), tuple(held)
        return replace(found, warnings=(*notes, *found.warnings), searched=searched)
    bench = with_scales(bench, model)
    situation = situation_of(model, records, bench.outputs)
    keys = [one.key for one in candidates]
    threshold = threshold_for(settings.calibrations, model, situation, settings.alpha, keys)
    bench = replace(bench, threshold=threshold.delta_bic, offered=frozenset(keys))
    search = _Search(model, noise, bench, candidates, settings, tell, nominal)
    found = search.on(bench, records, held)
    found = with_own_values(found, bench, records, held, search.anew, tell)
    if shows_only_there(found) and not found.differences:
        found = better_with_half_lent(found, search.anew(records, held, lent=True))
    found = without_odd_record(found, bench, records, held, search.anew, tell)
    found = with_early_input(found, settings.validation_fraction, nominal, tell)
    found = replace(found, warnings=(*notes, *found.warnings))
    odd = (*timing.check([*train, *validation]), *examine([*records, *held]))
    found = with_what_data_may_hide(found, odd, beyond_training(bench.train_free, bench.held_free))
    return with_threshold(found, threshold)


@dataclass(frozen=True)
class _Search:
    """Searches from one model and its noise, with the same candidates, on whatever data."""

    model: Model
    noise: Weighting | None
    bench: Bench
    candidates: Sequence[Effect]
    settings: Settings
    tell: Progress
    nominal: Mapping[str, float]

    def on(self, bench: Bench, train: Sequence[Record], held: Sequence[Record]) -> Diagnosis:
        """Search records as long as the settings allow, and say so where that was an end."""
        engine = Engine(bench, self.candidates, self.settings, self.tell, self.nominal)
        effort = self.settings.effort_for(sum(map(len, engine.train_records)))
        with counted_by(effort):
            found = engine.run(climb(self.model, bench, self.noise))
        found = replace(found, searched=(tuple(train), tuple(held)))
        return replace(found, warnings=(*found.warnings, CUT)) if effort.cut else found

    def anew(
        self, train: Sequence[Record], held: Sequence[Record], *, lent: bool = False
    ) -> Diagnosis:
        """Search other records of the motor, or half of the held-out ones as well."""
        if lent:
            self.tell('the held-out data show it more: fitting half of them, too')
        known = self.bench
        other = make_bench(
            train, held, known.kind, self.model, self.settings.validation_fraction, self.nominal,
            lent=lent,
        )  # fmt: skip
        other = replace(with_scales(other, self.model), threshold=known.threshold)
        return self.on(replace(other, offered=known.offered), train, held)


def _passed_over(asked: Sequence[str], model: Model) -> tuple[str, ...]:
    """Say which of the effects that were asked for make no sense for this motor."""
    idle = [
        effect(key).card.title for key in asked
        if key not in model.effects and not effect(key).after and not model.admits(effect(key))
    ]  # fmt: skip
    if idle and len(idle) == len(asked):
        raise UserError(
            f'none of the effects asked for makes sense for a {model.kind.title} recorded like '
            f'this: {listed(idle)}; docs/effects.md says what each needs'
        )
    what = f'for a {model.kind.title} recorded like this, and not tried'
    return (f'no sense {what}: {listed(idle)}',) if idle else ()


def with_what_data_may_hide(
    diagnosis: Diagnosis, findings: Iterable[Finding], further: Sequence[str] = ()
) -> Diagnosis:
    """Return the diagnosis; where something unknown is missing, first with what is odd about data.

    A signal that is out of step, or flat where it should not be, looks like physics that no
    catalogue holds; so the warnings among the doctor's `findings` come before all that is said of
    such physics, and what `further` is to be said of the data after them.
    """
    if diagnosis.verdict is not Verdict.UNKNOWN_EFFECT:
        return diagnosis
    odd = {f.code: f for f in findings if f.severity is Severity.WARNING}.values()
    said = [
        f'The data may be to blame: {f.message}. To do: {f.remedy or "look at them"}' for f in odd
    ]
    return replace(diagnosis, reasons=(*said, *further, *diagnosis.reasons))


def beyond_training(train: Sequence[Chain], held: Sequence[Chain]) -> tuple[str, ...]:
    """Say where the held-out data go much further than the training data, if they do.

    What shows only there (a bridge that loses voltage at high currents, a drag) cannot be learnt
    from the training data, however clearly the held-out ones miss it.
    """
    further = []
    for name in _REACHING:
        known, seen = _largest(train, name), _largest(held, name)
        if known > 0.0 and seen > FURTHER * known:
            unit = next(s.record.units[name] for c in train for s in c if name in s.record)
            further.append(
                f'{name.replace("_", " ")} to {seen:.3g} {unit} (training: {known:.3g})'
            )
    if not further:
        return ()
    return (
        f'The held-out data go further than the training data: {", ".join(further)}. What is '
        'missing may show only there. To do: train on such data, too',
    )


def _largest(chains: Sequence[Chain], name: str) -> float:
    """Return the size of a signal that one sample in a hundred of some stretch exceeds."""
    parts = [
        s.record[name][s.scored_from :]
        for chain in chains for s in chain if s.scored and name in s.record
    ]  # fmt: skip
    return max((float(np.percentile(np.abs(part), 99.0)) for part in parts), default=0.0)


def with_threshold(diagnosis: Diagnosis, threshold: Threshold) -> Diagnosis:
    """Return the diagnosis with what it asked of evidence, and in words why."""
    said = (threshold.words,)
    if threshold.alpha is None:
        return replace(
            diagnosis, calibration=threshold, warnings=(*diagnosis.warnings, *said)
        )
    return replace(diagnosis, calibration=threshold, reasons=(*diagnosis.reasons, *said))
