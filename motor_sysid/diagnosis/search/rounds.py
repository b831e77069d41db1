"""One round of a diagnosis: score every candidate on a fitted model, refit the best."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
import math

import numpy as np

from motor_sysid.diagnosis.candidates.proposals import proposals
from motor_sysid.diagnosis.candidates.score import score, Scored, Scores
from motor_sysid.diagnosis.candidates.variants import variants
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.further import (
    further_starts,
    RESTLESS,
    tried_again,
    unpromised,
)
from motor_sysid.diagnosis.search.gates import (
    ALIKE,
    MIN_FURTHER_GAIN_PERCENT,
    NO_EVIDENCE,
    TOO_LITTLE,
    UNCERTAIN,
    UNPHYSICAL,
)
from motor_sysid.diagnosis.search.lacking import following
from motor_sysid.diagnosis.search.ranking import (
    is_special,
    NEARLY_ALL,
    related,
    RIVAL_BIC,
    RIVAL_SHARE,
    SPECIAL_SHARE,
    winner_of,
)
from motor_sysid.diagnosis.search.refit import (
    leads_lower,
    of_a_kind,
    settled,
    try_beside,
    try_roughly,
    try_thoroughly,
)
from motor_sysid.diagnosis.search.rung import (
    ASTRAY,
    climb,
    FINER,
    leaves_much,
    profile_cost,
    Rung,
    slopes,
)
from motor_sysid.diagnosis.search.starts import best_per_effect
from motor_sysid.diagnosis.search.trial import Level, ONLY_NOISE, SURELY_MORE, Trial
from motor_sysid.estimation.batch import FitResult, Weighting
from motor_sysid.physics.effect import Effect
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.threads import in_threads

Tell = Callable[[str], None]

SHARE, BEHIND = 0.9, 100.0
"""A trial keeps its rough fit if its gain in BIC is less than this share of the best one's, and
this much behind it, or if it is a wider or a narrower form of the winner: it is no rival."""

OUTSHINES = 20.0
"""Fall of the held-out error, in percent, with which what has no evidence outshines what has some
and lowers that error by less than `MIN_FURTHER_GAIN_PERCENT`."""

BLIND = 1e-3
"""Relative rise of the whitened squares that is none where the training error falls that much: a
noise model that took what is missing for noise sees little else."""

WORTH_IT = 0.2 * MIN_FURTHER_GAIN_PERCENT
"""Fall of the held-out error after a rough fit, in percent, from which on a further effect is
fitted to all of the data though the model leaves nothing but noise, or though nothing passes: it
must come to five times as much."""


def scored(rung: Rung, bench: Bench, candidates: Sequence[Effect], tell: Tell) -> Scores:
    """Score every candidate that can be added to a fitted model."""
    problem, near = bench.problem(rung.model), slopes(rung, bench)
    train = [r for r, role in zip(bench.records, bench.roles, strict=True) if role == 'train']
    proposed = proposals(problem, near, train, candidates, bench.scales)
    tried = list(variants(rung.model, bench.scales, candidates, proposed))
    tell(f'scoring {len(tried)} variants of {len({v.effect.key for v in tried})} effects')
    return score(problem, problem.vector(), tried, near)


def unseen(scores: Scores) -> set[str]:
    """Return the effects that the motor's own parameters mimic to the last detail.

    On top of another effect such a one would only make up for the other's misfit.  What has
    evidence is seen: where much is missing, the noise model hides most of what is slow.
    """
    keys = {one.variant.effect.key for one in scores.singles}
    seen = [one for one in scores.singles if one.overlap < ALIKE or one.delta_bic > 0.0]
    return keys - {one.variant.effect.key for one in seen}


def promising(scores: Scores, limit: int) -> list[list[Scored]]:
    """Return the starts of at most `limit` effects, best first: the best score in any case.

    The others need evidence, unless they are a special case of one before them, or a wider form of
    an effect of the model: a friction that sticks and slips elsewhere may be what it takes, which
    no derivative tells.
    """
    chosen: list[list[Scored]] = []
    special: set[str] = set()
    for starts in best_per_effect(scores.singles, limit):
        one = starts[0].variant.effect
        wider = starts[0].variant.inherits
        if starts[0].delta_bic > 0.0 or wider or one.key in special or not chosen:
            special |= set(one.card.generalises)
            chosen.append(starts)
    return chosen


def refitted(
    scores: Scores,
    rung: Rung,
    bench: Bench,
    limit: int,
    tell: Tell,
    base: Rung | None = None,
    earlier: Mapping[str, FitResult] | None = None,
    *,
    thorough: bool = True,
) -> list[Trial]:
    """Refit at most `limit` effects, best score first, and then special cases of those.

    `base` is the fit of the model that had no effects yet; `earlier` are fits in which an effect
    was tried in place of one of the model's, to begin from there as well.  Where nothing helps
    and much is left, more effects are tried, and in full, if the round is to be `thorough`.

    Returns
    -------
    Those that pass before others, best first.
    """
    level = Level.of(rung, bench, scores.weighting, base)
    worth = WORTH_IT if rung.model.effects else 0.0
    chosen = promising(scores, limit)
    tell(f'trying {", ".join(starts[0].variant.effect.card.title for starts in chosen)}')

    def roughly(starts: Sequence[Scored]) -> Trial:
        key = starts[0].variant.effect.key
        return try_roughly(starts, level, bench, (earlier or {}).get(key), give_up=True)

    def again(start: Scored) -> Trial:
        return try_thoroughly(start, level, bench)

    def finally_(trial: Trial) -> Trial:
        if contends(trial):
            return settled(trial, level, bench)
        return trial if trial.rung is rung else replace(trial, rung=replace(trial.rung, near=()))

    def contends(trial: Trial) -> bool:
        if trial is winner or trial.delta_bic < min(SHARE * most, most - BEHIND):
            return trial is winner
        if winner is None and rung.model.effects and not level.is_incomplete:
            return trial.delta_bic > 0.0 and trial.gain_percent > WORTH_IT
        return trial.delta_bic > 0.0 if winner is None else not related(trial, winner)

    trials = in_threads(roughly, chosen)
    if level.cost > ONLY_NOISE * level.rows:
        trials += in_threads(roughly, unpromised(scores, trials))
    trials += _of_what_is_lacking(trials, scores, level, bench, roughly)
    if thorough and not helps(trials) and leaves_much(rung, bench, RESTLESS):
        lost = is_lost(rung, bench, base)
        count = (limit if base else None) if lost else 0
        more = further_starts(rung, bench, scores, trials, count)
        tell(f'nothing helps: trying {len(more) or "no"} effects more')
        trials += in_threads(roughly, more)
        if lost:
            trials = tried_again(trials, chosen + more, again, worth)
    trials = _beside_the_best(trials, level, bench)
    trials = _in_finer_steps(_special_cases_settled(trials, level, bench), level, bench)
    most = max((trial.delta_bic for trial in trials), default=0.0)
    passing = sorted((t for t in trials if t.passes), key=lambda t: -t.delta_bic)
    winner = winner_of(passing, filtered=bench.filtered) if passing else None
    tell(f'refitting the best {sum(map(contends, trials))} of {len(trials)}')
    trials = in_threads(finally_, trials)
    return sorted(trials, key=lambda t: (not t.passes, -t.delta_bic))


def _of_what_is_lacking(
    trials: Sequence[Trial],
    scores: Scores,
    level: Level,
    bench: Bench,
    fit: Callable[[Sequence[Scored]], Trial],
) -> list[Trial]:
    """Return trials of effects beside those whose laws follow what the equations lack.

    Only where nothing helps, or a model with effects leaves much.  Those with evidence are fitted
    in full: base parameters have taken in a part of what is missing and have far to go.
    """
    much = bool(level.rung.model.effects) and leaves_much(level.rung, bench)
    if not level.is_incomplete or (helps(trials) and not much):
        return []
    had = {trial.key for trial in trials}
    rough = in_threads(fit, following(level.rung, bench, scores.singles, had))
    return in_threads(lambda t: settled(t, level, bench) if t.delta_bic > 0.0 else t, rough)


def _beside_the_best(trials: Sequence[Trial], level: Level, bench: Bench) -> list[Trial]:
    """Return the trials, those of the kind of the best one begun again where that ended."""
    best = max((t for t in trials if t.passes), key=lambda t: t.delta_bic, default=None)
    if best is None or best.rung is level.rung:
        return list(trials)
    others = [t for t in trials if of_a_kind(t, best) and not related(t, best)]
    again = in_threads(lambda t: try_beside(t, best, level, bench), others)
    mended = dict(zip((t.key for t in others), again, strict=True))
    return [mended.get(t.key, t) for t in trials]


def _special_cases_settled(
    trials: Sequence[Trial], level: Level, bench: Bench
) -> list[Trial]:
    """Return the trials; special cases of the best one that explain most of it fitted in full.

    They would take its place, did they pass; and a fit to some of the data may just fail.
    """
    best = max((t for t in trials if t.passes), key=lambda t: t.delta_bic, default=None)
    if best is None:
        return list(trials)
    covered, enough = best.scored.variant.effect.card.generalises, SPECIAL_SHARE * best.delta_bic
    return [
        settled(t, level, bench)
        if not t.passes and t.key in covered and t.delta_bic > enough else t
        for t in trials
    ]  # fmt: skip


def _in_finer_steps(trials: Sequence[Trial], level: Level, bench: Bench) -> list[Trial]:
    """Return the trials; if none passes in coarse steps, those with evidence fitted in fine ones.

    A rough fit takes at most `FINER` steps a sample.  Where the model needs more, it makes up for
    what its integration does wrong, and the judgement in fine steps sees only the harm in that.
    """
    if bench.substeps <= FINER or any(trial.passes for trial in trials):
        return list(trials)
    most = max((trial.delta_bic for trial in trials), default=0.0)
    least = max(bench.threshold, SPECIAL_SHARE * most)
    harmed = [t for t in trials if t.delta_bic > least and t.note.startswith(TOO_LITTLE)]
    fine = in_threads(lambda trial: settled(trial, level, bench), harmed)
    mended = dict(zip((trial.key for trial in harmed), fine, strict=True))
    return [mended.get(trial.key, trial) for trial in trials]


def helps(trials: Sequence[Trial]) -> bool:
    """Whether something passes that is not outshone by what does not.

    Where base parameters are far astray, the noise model takes what is missing for noise: the
    truth may halve the held-out error and have no evidence, while a trifle has some.
    """
    gain = max((t.gain_percent for t in trials if t.passes), default=-np.inf)
    most = max((t.gain_percent for t in trials if t.note == NO_EVIDENCE), default=-np.inf)
    return gain > MIN_FURTHER_GAIN_PERCENT or (math.isfinite(gain) and most < OUTSHINES)


def led_back(trials: Sequence[Trial], rung: Rung, bench: Bench, weighting: Weighting) -> Rung:
    """Return the model fitted from where a trial ended that is nothing itself, if that is better.

    The parameters of a model may end in a valley far astray.  What then gains by an amplitude that
    is nothing, or impossible, and more than all that passes, has but found the way out; and so has
    a wider law that ends where it is the model's own, and maybe what lowers the training error
    most and does not pass.
    """
    most = max((t.delta_bic for t in trials if t.passes), default=bench.threshold)
    nothing = [
        t for t in trials
        if t.note in (UNCERTAIN, UNPHYSICAL) and t.delta_bic > most
        and t.gain_percent > MIN_FURTHER_GAIN_PERCENT
    ]  # fmt: skip
    nothing += [t for t in trials if t.passes and t.scored.variant.inherits and is_special(t)]
    lowest = min(trials, key=lambda t: t.rung.training.error_percent, default=None)
    ways = [max(nothing, key=lambda t: t.gain_percent)] if nothing else []
    if lowest and not lowest.passes and lowest not in ways:
        falls = lowest.rung.training.error_percent < ASTRAY * rung.training.error_percent
        ways += [lowest] if falls else []
    best, least = rung, profile_cost(rung, bench, weighting)[0]
    for way in ways:
        begun = _begun_where(way, rung.model)
        if not leads_lower(begun, best, bench):
            continue
        other = climb(begun, bench, weighting)
        cost = profile_cost(other, bench, weighting)[0]
        falls = other.training.error_percent < ASTRAY * best.training.error_percent
        allowed = (1.0 + BLIND) * least if falls else least - bench.threshold
        if other.held.error_percent < best.held.error_percent and cost < allowed:
            best, least = other, cost
    return best


def _begun_where(trial: Trial, model: Model) -> Model:
    """Return a model with what it shares with a fitted trial, as that has it."""
    found, card = trial.rung.model, trial.scored.variant.effect.card
    values = {p.name: found[p.name] for p in model.parameters.free if p.name in found.parameters}
    for key in set(card.replaces) & set(model.effects):
        values |= {
            f'{key}.{narrow}': found[f'{trial.key}.{wide}']
            for wide, narrow in card.replaces[key]
        }
    inside = model.parameters.inside(values)
    return model.with_values(inside).with_speed_sensor(found.speed_sensor)


def straightened(
    ladder: Sequence[tuple[Rung, list[Trial]]], threshold: float
) -> list[tuple[Rung, list[Trial]]]:
    """Return a ladder without the rungs of which an effect was taken back later.

    What was widened was not taken back.  All rungs stay if one of the effects that are left had no
    evidence but on such a rung.
    """
    (base, _), last = ladder[0], set(ladder[-1][0].model.effects)
    stay = last.union(*(effect(key).card.generalises for key in last))
    kept = [rung for rung in ladder[1:] if set(rung[0].model.effects) <= stay]
    straight: list[tuple[Rung, list[Trial]]] = []
    missing = last - set(base.model.effects)
    for rung, trials in [ladder[0], *kept]:
        told = {
            t.key for t in trials
            if t.key in last and t.delta_bic > threshold and t.rung is not rung
        } - set(rung.model.effects)  # fmt: skip
        straight.append((rung, [replace(t, note='') if t.key in told else t for t in trials]))
        missing -= told
    return list(ladder) if missing else straight


def explains(rung: Rung, base: Rung) -> bool:
    """Whether the effects of a model explain nearly all of the squared held-out error."""
    return rung.held.error_percent**2 < (1.0 - NEARLY_ALL) * base.held.error_percent**2


def is_lost(rung: Rung, bench: Bench, base: Rung | None = None) -> bool:
    """Whether a model leaves so many times the noise that what is missing may pass for noise.

    Not where it leaves little of what `base`, without effects, had left: no law is exact.
    """
    if base is not None and explains(rung, base):
        return False
    return leaves_much(rung, bench)


def tried_instead(rung: Rung, tried: Iterable[Trial]) -> dict[str, FitResult]:
    """Return the fits in which what widens an effect of a model was tried instead of it.

    A narrower law that explains most of a wider one goes first; the way from its fit back to that
    of the wider one may lead through valleys.  A fit beside effects that the model no longer has
    is one to begin from where there is no other.
    """
    mine, found = set(rung.model.effects), {}
    for trial in sorted(tried, key=lambda t: (-len(t.rung.model.effects), t.delta_bic)):
        narrower = mine & set(trial.scored.variant.effect.card.replaces)
        if narrower and set(trial.rung.model.effects) >= mine - narrower | {trial.key}:
            found[trial.key] = trial.rung.result
    return found


def accounted(base: Rung, last: Rung, bench: Bench, weighting: Weighting) -> float:
    """Return the share of what is beyond noise that a model explains, 0 to 1.

    Of whitened squares, so that noise of the sensors and random loads hide nothing: both models
    are judged under the noise that the whole dictionary leaves on the last one.
    """
    before, _ = profile_cost(base, bench, weighting)
    after, rows = profile_cost(last, bench, weighting)
    gained, left = max(before - after, 0.0), max(after - SURELY_MORE * rows, 0.0)
    return gained / max(gained + left, 1e-300)


def outdone(
    trials: Sequence[Trial], base: Rung, last: Rung, bench: Bench, weighting: Weighting
) -> bool:
    """Whether what cannot be, for its sign, has more evidence than all that is named together.

    `trials` were tried on `base` under the noise model `weighting`.  Of single causes the true one
    has most evidence.  Where the error falls by much, that speaks for itself, and the promise of a
    small touch says little.
    """
    if last.held.error_percent < (1 - MIN_FURTHER_GAIN_PERCENT / 100) * base.held.error_percent:
        return False
    before, rows = profile_cost(base, bench, weighting)
    after, _ = profile_cost(last, bench, weighting)
    extra = len(last.model.parameters.free) - len(base.model.parameters.free)
    gain = before - after - extra * float(np.log(rows))
    most = max((t.delta_bic for t in trials if t.note == UNPHYSICAL), default=-np.inf)
    return most > gain + max(RIVAL_BIC, RIVAL_SHARE * gain)
