"""What else is tried where nothing helps and much is left.

Then parameters may be far astray, and the noise model of the whole dictionary may take what is
missing for noise: scores tell little of which effect it is, and evidence is weighed anew.
"""

from collections.abc import Callable, Iterator, Sequence, Set
from dataclasses import replace

import numpy as np

from motor_sysid.diagnosis.candidates.score import score, Scored, Scores
from motor_sysid.diagnosis.candidates.variants import Variant
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.gates import MIN_FURTHER_GAIN_PERCENT, UNPHYSICAL
from motor_sysid.diagnosis.search.refit import better_of, chatters, WIDE
from motor_sysid.diagnosis.search.rung import Rung, slopes
from motor_sysid.diagnosis.search.starts import best_per_effect, STARTS
from motor_sysid.diagnosis.search.trial import Trial

THOROUGH = 3
"""Effects that are fitted in full if nothing passes and the model leaves much, and most effects
that are tried for their resemblance."""

RESEMBLES = 0.05
"""Share of the squared training error, as it is, that a touch of an effect must explain to be
tried for its resemblance."""

RESTLESS = 1.5
"""Held-out error in units of the sensor noise from which on something may pass for noise that the
error looks like as it is."""


def unpromised(scores: Scores, trials: Sequence[Trial]) -> list[list[Scored]]:
    """Return the starts of effects beside `trials` whose score tells nothing of their worth.

    A finite trial (a delay, a lag) is scored beside base parameters that may have gone far astray
    to make up for the effect: an inductance, say, for the lag of a sensor.  They have their turn
    where nothing passes.  Of a load behind a play a touch tells that there is something, and not
    of which sign: where what passes lowers the held-out error by little, such loads have theirs.
    """
    tried = {trial.key for trial in trials}
    best = max((trial.gain_percent for trial in trials if trial.passes), default=-np.inf)

    def has_a_turn(one: Scored) -> bool:
        if best == -np.inf and not one.variant.model.parameters.free:
            return True
        weak = best < MIN_FURTHER_GAIN_PERCENT
        return weak and bool(one.variant.effect.card.grids) and one.delta_bic > 0.0

    further = [o for o in scores.singles if o.variant.effect.key not in tried and has_a_turn(o)]
    return best_per_effect(further, len(further))


def passed_over(scores: Scores, tried: Set[str]) -> list[list[Scored]]:
    """Return the starts of effects that have evidence and were not among the best.

    Where the motor's parameters have gone far astray, a small touch of what is missing may tell
    less than touches of much else, and little of its shape.
    """
    further = [
        one for one in scores.singles
        if one.variant.effect.key not in tried and one.delta_bic > 0.0 and one.allowed
    ]  # fmt: skip
    keys = dict.fromkeys(one.variant.effect.key for one in further)
    return [[one for one in further if one.variant.effect.key == key][:STARTS] for key in keys]


def further_starts(
    rung: Rung, bench: Bench, scores: Scores, trials: Sequence[Trial], most: int | None
) -> list[list[Scored]]:
    """Return the starts of effects beside `trials`: at most so many with evidence, and alike ones.

    Those are what the error looks like.
    """
    tried = {trial.key for trial in trials}
    best = passed_over(scores, tried)[:most]
    mine = {starts[0].variant.effect.key for starts in best}
    return best + resembling(rung, bench, scores, tried | mine)


def resembling(rung: Rung, bench: Bench, scores: Scores, tried: Set[str]) -> list[list[Scored]]:
    """Return the starts of effects, but for those that were tried, that the error looks like.

    As it is, that is, whatever a noise model makes of it: where another law is sharp and not right
    yet, its jumps are all that a whitened error shows, and a constant friction passes for noise.
    Where a current chatters about its sign, a small touch of anything moves the jumps most; beside
    a wider sign it shows what else it does.
    """
    variants = [one.variant for one in scores.singles if one.variant.effect.key not in tried]
    near = slopes(rung, bench)
    least = RESEMBLES * sum(one.residual.size for one in near)
    problem = bench.problem(rung.model)
    found = list(score(problem, problem.vector(), variants, near, whitened=False).singles)
    if chatters(rung.model):
        found += beside_wider_signs(rung, bench, variants)
    alike = [one for one in found if one.gain > least and one.allowed]
    return best_per_effect(sorted(alike, key=lambda one: -one.delta_bic), THOROUGH)


def beside_wider_signs(
    rung: Rung, bench: Bench, variants: Sequence[Variant]
) -> Iterator[Scored]:
    """Score variants, as the error is, beside a sign of current that is wider."""
    width = rung.model['i_eps']

    def with_width(variant: Variant, value: float) -> Variant:
        return replace(variant, model=variant.model.with_values({'i_eps': value}))

    wide = {'i_eps': WIDE[-1] * width}
    problem = bench.problem(rung.model.with_values(wide))
    start = problem.vector()
    wider = [with_width(variant, wide['i_eps']) for variant in variants]
    for one in score(problem, start, wider, problem.linearize(start), whitened=False).singles:
        yield replace(one, variant=with_width(one.variant, width), base={})


def tried_again(
    trials: Sequence[Trial],
    chosen: Sequence[Sequence[Scored]],
    fit: Callable[[Scored], Trial],
    least: float,
) -> list[Trial]:
    """Return the trials, those that lower the held-out error most after another fit.

    They must lower it by more than the `least`, in percent.  What began at the best of a grid has
    been everywhere.
    """
    first = [one[0] for one in chosen if not one[0].variant.effect.card.grids]
    starts = {one.variant.effect.key: one for one in first}
    possible = [
        t for t in trials if t.key in starts and t.note != UNPHYSICAL and t.gain_percent > least
    ]
    best = sorted(possible, key=lambda t: -t.gain_percent)[:THOROUGH]
    fitted = {t.key: better_of(t, fit(starts[t.key])) for t in best}
    return [fitted.get(t.key, t) for t in trials]
