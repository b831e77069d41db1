"""The single steps of a diagnosis, for those who go by hand: fit, compare, add."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from motor_sysid.diagnosis.candidates.proposals import proposals
from motor_sysid.diagnosis.candidates.score import score
from motor_sysid.diagnosis.candidates.variants import refusal, variants
from motor_sysid.diagnosis.result.curves import Where
from motor_sysid.diagnosis.search.bench import (
    base_fit,
    Bench,
    make_bench,
    prepared,
    with_scales,
)
from motor_sysid.diagnosis.search.integration_steps import exact, refined
from motor_sysid.diagnosis.search.ready import ready
from motor_sysid.diagnosis.search.refit import try_effect
from motor_sysid.diagnosis.search.refusals import refuse_few, refuse_gaps
from motor_sysid.diagnosis.search.rung import climb, judge, Rung, with_better_sensor
from motor_sysid.diagnosis.search.starts import best_per_effect
from motor_sysid.diagnosis.search.trial import Level, Trial
from motor_sysid.diagnosis.where.compare import compare, Comparison, where_it_fails
from motor_sysid.errors import UserError
from motor_sysid.estimation.batch import (
    believed,
    make_chain,
    observed_outputs,
    Problem,
    refit,
    sensors_of,
    Transfer,
    transfer,
)
from motor_sysid.estimation.batch.sisters import SPREAD
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.effect import Card
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record


def fit_model(
    train: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    model: Model | None = None,
    motor: str | None = None,
    nominal: Mapping[str, float] | None = None,
    effects: Sequence[str] = (),
    method: str = 'least_squares',
    validation_fraction: float = 0.2,
    lent: bool = False,
) -> Rung:
    """Fit a model, or the linear model of a motor kind with the named effects.

    Each effect is started from what its score proposes, so that a fit does not stay at zero.  As
    at the end of a diagnosis, steps and signs are so fine that they hardly move a parameter, and
    standard errors hold for correlated noise.  Any other `method` (key of
    `motor_sysid.estimation.batch.METHODS`) begins where least squares end.  With `lent`, half of
    the held-out data are fitted as well (`motor_sysid.diagnosis.lending`).

    Returns
    -------
    The fit, with its free-running errors on the training and held-out data.
    """
    for key in effects:
        effect(key)
    bench, model = bench_of(
        train, validation, model, motor, nominal or {}, validation_fraction, lent=lent
    )
    rung = climb(model, bench)
    for key in effects:
        if key not in rung.model.effects:
            rung = _tried(rung, key, bench).rung
    if rung.model.effects:
        rung = with_better_sensor(rung, bench, rung.result.weighting)
        rung, bench = refined(rung, bench)
    if method == 'least_squares':
        return _noted(exact(rung, bench)[0], bench)
    stretches = [s for chain in bench.train_free for s in chain if s.scored]
    return _noted(judge(refit(rung.model, [s.record for s in stretches], method), bench), bench)


def transfer_model(
    train: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    sisters: Sequence[Model],
    spread: float = SPREAD,
    spreads: Mapping[str, float] | None = None,
    validation_fraction: float = 0.2,
) -> tuple[Rung, Transfer]:
    """Fit a motor of which little is recorded, with the models of its sisters as prior.

    See `motor_sysid.estimation.batch.sisters.believed` for what sisters and spreads say.

    Returns
    -------
    The fit with its errors, and what came from the data and what from the prior.
    """
    model, prior = believed(sisters, spread, spreads)
    bench, model = bench_of(train, validation, model, None, {}, validation_fraction)
    problem = Problem(model, bench.train, bench.outputs, substeps=bench.substeps, prior=prior)
    found = transfer(problem)
    return _noted(judge(found.result, bench), bench), found


def compare_model(
    model: Model, records: Sequence[Record]
) -> tuple[Comparison, tuple[Where, ...]]:
    """Run a model over records, freely, and say where it fails."""
    evens = prepared(records, model.motor, model.parameters.values())
    outputs = observed_outputs(model.kind, evens)
    for record in evens:
        refuse_gaps(record, {*input_signals(record, model.kind), *outputs} & set(record))
    sensors = sensors_of(evens, model.kind)
    chains = [make_chain(r, model.kind, outputs, sensors=sensors) for r in evens]
    comparison = compare(model, chains, outputs)
    return comparison, where_it_fails(model, evens, comparison)


def add_effect(
    model: Model,
    key: str,
    train: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    validation_fraction: float = 0.2,
    progress: Callable[[str], None] | None = None,
) -> tuple[Rung, Trial]:
    """Add one effect to a model and refit.

    Returns
    -------
    The model before, fitted, and the trial of the effect with its evidence.

    Raises
    ------
    UserError
        If the effect is unknown or makes no sense for this model or these data.
    """
    tell = progress or (lambda text: None)
    model.with_effect(key)
    _refuse(key, refusal(model, effect(key)))
    bench, model = bench_of(train, validation, model, None, {}, validation_fraction)
    tell('fitting the model as it is')
    before = climb(model, bench)
    tell(f'adding {effect(key).card.title}')
    return before, _tried(before, key, bench)


def bench_of(
    train: Sequence[Record],
    validation: Sequence[Record],
    model: Model | None,
    motor: str | None,
    nominal: Mapping[str, float],
    fraction: float,
    *,
    lent: bool = False,
) -> tuple[Bench, Model]:
    """Return the data, prepared, and the model: the given one, or a fitted linear one."""
    refuse_few([*train, *validation])
    records, held, kind, nominal, notes = ready(train, validation, model, motor, nominal)
    bench = make_bench(records, held, kind, model, fraction, nominal, lent=lent)
    bench = replace(bench, notes=notes + bench.notes)
    if model is None:
        model = base_fit(records, kind, bench.train, bench.outputs, nominal).model
    return with_scales(bench, model), model


def bare(rung: Rung, bench: Bench) -> Rung | None:
    """Return the fit of a model without its effects; None if it has none."""
    model = rung.model
    for key in model.effects:
        model = model.without_effect(key)
    return climb(model, bench, briefly=True) if rung.model.effects else None


def _noted(rung: Rung, bench: Bench) -> Rung:
    """Return a fit that says of the data what is to be said."""
    warnings = (*bench.notes, *rung.result.warnings)
    return replace(rung, result=replace(rung.result, warnings=warnings))


def _tried(rung: Rung, key: str, bench: Bench) -> Trial:
    train = [r for r, role in zip(bench.records, bench.roles, strict=True) if role == 'train']
    one = effect(key)
    problem = bench.problem(rung.model)
    near = problem.linearize(problem.vector())
    proposed = proposals(problem, near, train, [one], bench.scales)
    found = list(variants(rung.model, bench.scales, [one], proposed))
    if not found:
        _refuse(key, refusal(rung.model, one) or _unseen(one.card))
    scores = score(problem, problem.vector(), found, near)
    level = Level.of(rung, bench, scores.weighting, bare(rung, bench))
    return try_effect(best_per_effect(scores.singles, 1)[0], level, bench)


def _refuse(key: str, why: str) -> None:
    """Refuse an effect if there is a reason."""
    if why:
        raise UserError(f'{effect(key).card.title} cannot be added: {why}')


def _unseen(card: Card) -> str:
    """Say what an effect needs that is looked for in the data, and was not found."""
    if card.orders:
        return 'no number of waves per turn stands out of the data'
    return f'no {"frequency" if card.frequency else "moment"} stands out of the data'
