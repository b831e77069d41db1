"""From rungs and trials to the steps and candidates that people see, with evidence curves."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.curves import Curve
from motor_sysid.diagnosis.result.result import Candidate, Step
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.refit import parameters_of
from motor_sysid.diagnosis.search.rung import Rung
from motor_sysid.diagnosis.search.trial import Ladder, Trial
from motor_sysid.diagnosis.where.equation_errors import lacking_name
from motor_sysid.diagnosis.where.unexplained import Lack, lack_of, orthogonal
from motor_sysid.diagnosis.where.where import Failure, failure_of, mean_in
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.signals.record import Record
from motor_sysid.threads import in_threads

Array = NDArray[np.float64]


def steps_of(
    ladder: Ladder, rivals: Mapping[str, tuple[str, ...]], bench: Bench
) -> tuple[Step, ...]:
    """Turn a ladder into lines of the report; what was added next comes first in each."""
    after = [rung.model.effects for rung, _ in (*ladder[1:], ladder[-1])]
    stages = [
        (rung, sorted(trials, key=lambda t: t.key not in added))
        for (rung, trials), added in zip(ladder, after, strict=True)
    ]
    return tuple(in_threads(lambda stage: step_of(*stage, rivals, bench), stages))


def step_of(
    rung: Rung, trials: Sequence[Trial], rivals: Mapping[str, tuple[str, ...]], bench: Bench
) -> Step:
    """Turn a rung, with what was tried on it, into a line of the report."""
    predictions = (*rung.training.predictions, *rung.validation.predictions)
    failure = failure_of(rung.model, bench.records, bench.roles, predictions)
    return Step(
        model=rung.model,
        train_error_percent=rung.training.error_percent,
        validation_error_percent=rung.validation.error_percent,
        channel_errors=rung.validation.channel_percent,
        predictions=predictions,
        where=failure.where,
        curves=failure.curves,
        maps=failure.maps,
        candidates=tuple(
            candidate_of(t, rung, failure, rivals.get(t.key, ()), bench.records) for t in trials
        ),
    )


def notes_of(ladder: Ladder, bench: Bench, *, named: bool) -> tuple[str, ...]:
    """Return what the fit of the model that is shown says: the first one if nothing is named."""
    result = ladder[-1 if named else 0][0].result
    return *result.unidentifiable, *result.warnings, *half_a_sample(result.model, bench)


def half_a_sample(model: Model, bench: Bench) -> tuple[str, ...]:
    """Say what a delay or a filter owes to the speed sensor, where the speed is all there is."""
    late = [
        f'{one.key}.{one.card.delay or one.card.filter}'
        for one in map(model.effect, model.effects)
        if one.card.delay or one.filters_speed
    ]
    record = bench.records[0]
    alone = bench.outputs == ('speed',) and 'position' not in record
    torn = {SpeedSensor.IDEAL, SpeedSensor.DIFFERENCE} <= {*bench.sensors}
    if not (late and alone and torn):
        return ()
    mean = model.speed_sensor is SpeedSensor.DIFFERENCE
    taken, other = 'its mean over a sample, as of counts', 'that of the moment'
    taken, other, by = (taken, other, 'longer') if mean else (other, taken, 'shorter')
    return (
        f'the speed is taken as {taken}; if it is {other}, {late[0]} is {500 * record.dt:.3g} ms '
        f'{by}: record the position too, which tells',
    )


def as_trifles(step: Step) -> Step:
    """Return the line of a complete model, on which what passes is said to be too little."""
    said = 'what it explains is too little to be named'
    return replace(
        step, candidates=tuple(replace(one, note=one.note or said) for one in step.candidates)
    )


def candidate_of(
    trial: Trial,
    base: Rung,
    failure: Failure,
    rivals: Sequence[str],
    records: Sequence[Record],
) -> Candidate:
    """Describe a trial of an effect on the base model that fails as given on the records."""
    one = trial.scored.variant.effect
    return Candidate(
        effect=one.key,
        title=one.card.title,
        equation=one.card.enters.value,
        law=one.card.equation,
        delta_bic=trial.delta_bic,
        train_error_percent=trial.rung.training.error_percent,
        validation_error_percent=trial.rung.validation.error_percent,
        parameters=parameters_of(trial.rung.model, one.key),
        confusable_with=tuple(rivals),
        passes=trial.passes,
        note=trial.note,
        curve=_curve(trial, base, failure, records),
        model=trial.rung.model,
        predictions=(*trial.rung.training.predictions, *trial.rung.validation.predictions),
    )


def _curve(
    trial: Trial, base: Rung, failure: Failure, records: Sequence[Record]
) -> Curve | None:
    """Return the curve on the effect's axis, and what the refitted model says it should be.

    Only a trial that passes gets that law: its run is one of the costs of a diagnosis.
    """
    one = trial.scored.variant.effect
    forces = [f.name for f in base.model.kind.forces]
    force = next((name for name in one.laws if name in forces), forces[0])
    wanted = lacking_name(base.model, force)
    curve = next(
        (c for c in failure.curves if c.axis == one.card.axis and c.quantity == wanted), None
    )
    if curve is None or not trial.passes or trial.rung.model is base.model:
        return curve
    told = orthogonal(_difference(trial.rung, base, failure, records), failure.share)
    axis = failure.axes[curve.axis]
    mean = mean_in(axis, [part.forces[force] for part in told])
    shown = np.clip(np.digitize(curve.x, axis.edges) - 1, 0, axis.count - 1)
    return replace(curve, law=np.nan_to_num(mean[shown]))


def _difference(
    refitted: Rung, base: Rung, failure: Failure, records: Sequence[Record]
) -> list[Lack]:
    """Return what the base would lack if the refitted model were the truth, free of noise."""
    before, after = (
        (*r.training.predictions, *r.validation.predictions) for r in (base, refitted)
    )
    return [
        replace(lack_of(base.model, record, old, new), states=seen.states)
        for record, old, new, seen in zip(records, before, after, failure.lacks, strict=True)
    ]
