"""One round of a diagnosis, for those who go by hand: a model, and what is tried on it."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from motor_sysid.diagnosis.engine import Engine
from motor_sysid.diagnosis.fitting import bare, bench_of, fit_model
from motor_sysid.diagnosis.result.result import Step
from motor_sysid.diagnosis.search.integration_steps import refined
from motor_sysid.diagnosis.search.ranking import chosen
from motor_sysid.diagnosis.settings import Settings
from motor_sysid.diagnosis.verdict.evidence import step_of
from motor_sysid.physics.effects import catalogue, effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record


def one_round(
    model: Model,
    train: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    effects: Sequence[str] | None = None,
    settings: Settings | None = None,
    threshold: float | None = None,
    lent: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Step:
    """Fit a model and try every candidate on it: one rung of the ladder of a diagnosis.

    Parameters
    ----------
    model:
        With the effects that it is to have.
    train, validation:
        As in `motor_sysid.diagnosis.diagnose`.
    effects:
        Candidates; by default the whole catalogue.
    settings, progress:
        As in `motor_sysid.diagnosis.diagnose`.
    threshold:
        Evidence (gain in BIC) asked of a candidate; by default that of a motor that was not
        calibrated.
    lent:
        Whether half of the held-out data are fitted as well (`motor_sysid.diagnosis.lending`).

    Raises
    ------
    UserError
        If the records cannot be used, or an effect is unknown.
    """
    settings = settings or Settings()
    fraction = settings.validation_fraction
    rung = fit_model(train, validation, model=model, validation_fraction=fraction, lent=lent)
    bench, _ = bench_of(train, validation, rung.model, None, {}, fraction, lent=lent)
    if threshold is not None:
        bench = replace(bench, threshold=threshold)
    rung, bench = refined(rung, bench)
    candidates = [effect(key) for key in effects or catalogue()]
    engine = Engine(bench, candidates, settings, progress or (lambda text: None), {})
    rung, trials = engine.round(rung, bare(rung, bench))
    rivals = {}
    if any(t.passes for t in trials):
        best, equals = chosen(trials, rung, filtered=bench.filtered)
        rivals[best.key] = equals
    return step_of(rung, trials, rivals, bench)
