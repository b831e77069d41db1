"""Choose the experiment that separates fitted rivals, or informs one model's parameters."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from motor_sysid.diagnosis.experiment import words
from motor_sysid.diagnosis.experiment.determine import determine, Gain, weak_parameters
from motor_sysid.diagnosis.experiment.discriminate import discriminate, Found
from motor_sysid.diagnosis.experiment.information import known
from motor_sysid.diagnosis.experiment.limits import Limits, limits_of
from motor_sysid.diagnosis.experiment.relax import would_help
from motor_sysid.diagnosis.experiment.result import Experiment, Separation, Sharpening
from motor_sysid.diagnosis.experiment.rivals import MOST
from motor_sysid.diagnosis.experiment.stage import Stage, THOROUGH
from motor_sysid.diagnosis.search.bench import prepared
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Tell = Callable[[str], None]

QUICK, USUAL, FINE = 2_000, 4_000, 10_000
"""Most samples of a simulated experiment; a faster record is thinned out to that.  In a hurry,
while experiments are compared, and when the best are proved."""


def suggest_experiment(
    models: Sequence[Model],
    records: Record | Sequence[Record],
    limits: Limits | None = None,
    *,
    parameters: Sequence[str] = (),
    quick: bool = True,
    progress: Tell | None = None,
) -> Experiment | None:
    """Return the experiment that separates fitted rivals, or informs one model's parameters.

    Parameters
    ----------
    models:
        Two to four rivals of one motor kind, fitted to the records, and more are left out; or one
        model, whose weak parameters are asked for.
    records:
        What they were fitted to.
    limits:
        What the motor must not exceed; by default what it has done in the records.
    parameters:
        With one model: the parameters in question, by default those that the data tell least of.
    quick:
        Try a handful of speed profiles, coarsely sampled, with linearised refits: well under a
        second.  Otherwise the whole library, with real refits of what is proposed.
    progress:
        Is told what is going on.

    Returns
    -------
    None where nothing is open: one model without a free parameter.

    Raises
    ------
    UserError
        If a parameter is unknown, or the motor has more than one input.
    """
    every, models = tuple(models), tuple(models)[:MOST]
    if not models or not any(m.parameters.free for m in models):
        return None
    given = [records] if isinstance(records, Record) else records
    evens = prepared(given, models[0].motor, models[0].parameters.values())
    limits = limits or limits_of(evens, models[0].kind)
    stage = Stage(models, evens, limits, QUICK if quick else USUAL)
    tell = progress or (lambda text: None)
    if len(models) > 1:
        fine = None if quick else Stage(models, evens, limits, FINE, THOROUGH)
        made = _separation(stage, discriminate(stage, fine, quick=quick, tell=tell), quick)
        return replace(made, reasons=words.left_out(words.names(every)[MOST:]) + made.reasons)
    asked = tuple(parameters) or weak_parameters(models[0], known(stage, models[0]))
    _refuse(models[0], asked)
    return _determination(stage, determine(stage, asked, quick=quick, tell=tell), asked)


def _refuse(model: Model, asked: Sequence[str]) -> None:
    for name in asked:
        if not model.parameters[name].free:
            raise UserError(f'`{name}` is held fixed in this model; free it, or ask for another')


def _separation(stage: Stage, found: Found | None, quick: bool) -> Experiment:
    rivals = words.names(stage.models)
    purpose = f'to tell {words.told_apart(rivals)}'
    if found is None:
        return _impossible(purpose, stage.limits)
    expected = tuple(
        Separation((rivals[a], rivals[b]), value, found.worst.get((a, b)))
        for (a, b), value in found.pairs.items()
    )
    if found.decides:
        summary, reasons = words.separated(found, rivals), words.doubts(found, rivals)
        return _experiment(stage, found, purpose, summary, reasons, expected)
    reasons = words.alike(stage, found, rivals)
    if not quick:
        reasons += words.more_time(found.pairs, stage.limits) + would_help(stage)
    return Experiment(
        False, purpose, words.not_separated(found, rivals), reasons, stage.limits,
        separations=expected,
    )  # fmt: skip


def _determination(stage: Stage, gain: Gain | None, asked: Sequence[str]) -> Experiment:
    purpose = f'to determine {", ".join(asked)}'
    if gain is None:
        return _impossible(purpose, stage.limits)
    before, after = gain.before.sigma(), gain.after.sigma()
    free = gain.before.problem.free
    sharper = tuple(
        Sharpening(free[k].name, free[k].unit, free[k].value, float(before[k]), float(after[k]))
        for k in gain.rows
    )
    reasons = words.combination(gain.after)
    if not gain.decides:
        summary = words.not_sharpened(gain, asked)
        reasons = (*reasons, words.at_best(gain, asked))
        return Experiment(False, purpose, summary, reasons, stage.limits, sharpenings=sharper)
    summary = words.sharpened(gain, asked)
    return _experiment(stage, gain, purpose, summary, reasons, sharpenings=sharper)


def _impossible(purpose: str, limits: Limits) -> Experiment:
    return Experiment(
        False, purpose, 'no experiment of the library stays within the limits',
        ('Even at a hundredth of its level every profile breaks a limit: widen the limits.',),
        limits,
    )  # fmt: skip


def _experiment(
    stage: Stage,
    chosen: Found | Gain,
    purpose: str,
    summary: str,
    reasons: tuple[str, ...],
    separations: tuple[Separation, ...] = (),
    sharpenings: tuple[Sharpening, ...] = (),
) -> Experiment:
    one = chosen.tried
    peaks = {
        name: max(run.peaks[name] for run in one.runs) for name in one.runs[0].peaks
    }
    return Experiment(
        True, purpose, summary, reasons, stage.limits, one.profile, one.choice.family.title,
        separations, sharpenings, peaks, stage.loops[0].gains,
    )  # fmt: skip
