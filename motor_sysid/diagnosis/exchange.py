"""Whether another set of effects does better than the one that was climbed to.

Effects are added one by one; what explained most alone need not be part of the truth.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from motor_sysid.diagnosis.apart import Compared
from motor_sysid.diagnosis.refit import (
    best_per_effect,
    Level,
    settled_pair,
    Trial,
    try_effect,
    try_pair,
)
from motor_sysid.diagnosis.rounds import ONLY_NOISE, WORKERS
from motor_sysid.diagnosis.rung import climb, profile_cost, Rung, vanished
from motor_sysid.diagnosis.score import Scores
from motor_sysid.diagnosis.setup import Bench
from motor_sysid.diagnosis.verdict import RIVAL_BIC, RIVAL_SHARE
from motor_sysid.physics.effects import effect

ALTERNATIVE = 0.8
"""Share of an effect's gain that another one must promise to be tried in its place."""

PROMISING = 0.97
"""Share of the best rough gain of a pair that another pair must reach to be fitted in full."""


@dataclass(frozen=True)
class Exchange:
    """Looks for better sets of effects.

    Attributes
    ----------
    bench:
        The data.
    seen:
        Sets of effects that were fitted and scored.
    gains:
        Gain in BIC of each effect when it was added; what is exchanged is noted here.
    compared:
        Effect and rival to the fits that do as well as each other; what is found is noted here.
    score:
        Scores every candidate on a fit, and remembers both in `seen`.
    tell:
        Is told what is found.
    """

    bench: Bench
    seen: dict[frozenset[str], tuple[Rung, Scores]]
    gains: dict[str, float]
    compared: dict[tuple[str, str], Compared]
    score: Callable[[Rung], Scores]
    tell: Callable[[str], None]

    def better(
        self, rung: Rung, start: Sequence[str], rivals: dict[str, tuple[str, ...]]
    ) -> Rung | None:
        """Return a better model in which one effect gives way to another one, or to two.

        Another effect that does as well is noted in `rivals`.
        """
        own = [key for key in rung.model.effects if key not in start]
        cost, rows = profile_cost(
            rung, self.bench, self.seen[frozenset(rung.model.effects)][1].weighting
        )
        left = cost - ONLY_NOISE * rows
        doubtful = [key for key in own if left > RIVAL_SHARE * self.gains.get(key, 0.0)]
        if left < 0 or not doubtful:
            return None
        first = self.seen[frozenset(start)][1].pairs
        if first and {one.variant.effect.key for one in first[0]} == set(own):
            return None
        for key in doubtful:
            slim, scores = self.without(rung, key)
            level = Level.of(slim, self.bench, scores.weighting)
            mine = level.gain(rung, self.bench)
            if len(own) > 1:
                for trial in self.substitutes(key, level, scores, mine):
                    if trial.delta_bic > mine + max(RIVAL_BIC, RIVAL_SHARE * mine):
                        self.tell(f'{trial.key} does better than {key}')
                        self.gains[trial.key] = trial.delta_bic
                        return climb(trial.rung.model, self.bench, rung.result.weighting)
                    if trial.key not in rivals.get(key, ()):
                        rivals[key] = (*rivals.get(key, ()), trial.key)
                    self.compared[key, trial.key] = _compared(slim, rung, trial.rung)
            better = self.best_pair(key, level, scores, mine, rivals)
            if better is not None and better.held.error_percent < rung.held.error_percent:
                return climb(better.model, self.bench, rung.result.weighting)
        return None

    def without(self, rung: Rung, key: str) -> tuple[Rung, Scores]:
        """Return the fit without one effect, and what then scores."""
        left = frozenset(rung.model.effects) - {key}
        if left not in self.seen:
            slim = climb(rung.model.without_effect(key), self.bench, rung.result.weighting)
            self.score(slim)
        return self.seen[left]

    def best_pair(
        self,
        key: str,
        level: Level,
        scores: Scores,
        gain: float,
        rivals: dict[str, tuple[str, ...]],
    ) -> Rung | None:
        """Return the pair of effects that does better than one, if there is one.

        A pair that only widens an effect of the model had its turn when that was tried alone.

        Pairs that do as well and have one effect in common make rivals of the two others.
        """
        worth = [
            pair
            for pair in scores.pairs
            if pair[0].gain > ALTERNATIVE * gain and not any(one.variant.inherits for one in pair)
        ]
        with ThreadPoolExecutor(WORKERS) as pool:
            rough = pool.map(lambda pair: try_pair(pair, level, self.bench), worth)
            tried = [(*fitted, pair) for fitted, pair in zip(rough, worth, strict=True)]
            near = max(PROMISING * max((one[1] for one in tried), default=0.0), gain)
            fits = pool.map(
                lambda one: (*settled_pair(one[0], level, self.bench), one[2]),
                [one for one in tried if one[1] > near],
            )
            tried = [
                one
                for one in fits
                if not any(vanished(one[0].model, part.variant.effect.key) for part in one[2])
            ]
        tried.sort(key=lambda one: -one[1])
        if not tried or not tried[0][1] > gain + max(RIVAL_BIC, RIVAL_SHARE * gain):
            return None
        best = {one.variant.effect.key for one in tried[0][2]}
        for fitted, other, pair in tried[1:]:
            keys = {one.variant.effect.key for one in pair}
            if other > tried[0][1] - RIVAL_BIC and len(keys & best) == 1:
                mine, theirs = (best - keys).pop(), (keys - best).pop()
                rivals[mine] = (*rivals.get(mine, ()), theirs)
                slim = climb(
                    tried[0][0].model.without_effect(mine), self.bench, briefly=True
                )
                self.compared[mine, theirs] = _compared(slim, tried[0][0], fitted)
        self.tell(f'{" and ".join(sorted(best))} together do better than {key}')
        self.gains.update(dict.fromkeys(best, tried[0][1]))
        return tried[0][0]

    def substitutes(
        self, key: str, level: Level, scores: Scores, gain: float
    ) -> Iterator[Trial]:
        """Yield what explains the data as well as an effect that was taken out, or better."""
        related = {key, *effect(key).card.generalises}
        others = [s for s in scores.singles if s.variant.effect.key not in related]
        for starts in best_per_effect(others, 2):
            if key not in starts[0].variant.effect.card.generalises and (
                starts[0].delta_bic > ALTERNATIVE * gain
            ):
                trial = try_effect(starts, level, self.bench)
                if trial.passes and trial.delta_bic > gain - RIVAL_BIC:
                    yield trial


def _compared(base: Rung, one: Rung, two: Rung) -> Compared:
    """Return what two fits that do as well as each other are compared by."""
    without, first, second = (
        (*rung.training.predictions, *rung.validation.predictions) for rung in (base, one, two)
    )
    return Compared(without, first, second, (one.model, two.model))
