"""Whether another set of effects does better than the one that was climbed to.

Effects are added one by one; what explained most alone need not be part of the truth.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from motor_sysid.diagnosis.candidates.score import Scores
from motor_sysid.diagnosis.result.names import titles
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.confusable import alike, Compared, compared
from motor_sysid.diagnosis.search.gates import is_usual, MIN_FURTHER_GAIN_PERCENT
from motor_sysid.diagnosis.search.prune import pruned, runs_clearly_better
from motor_sysid.diagnosis.search.ranking import (
    margin_of,
    may_rival,
    related,
    RIVAL_BIC,
    RIVAL_SHARE,
)
from motor_sysid.diagnosis.search.refit import (
    parameters_of,
    settled,
    settled_pair,
    try_effect,
    try_pair,
)
from motor_sysid.diagnosis.search.rung import climb, profile_cost, Rung, SPOILED
from motor_sysid.diagnosis.search.sense import is_impossible, senseless
from motor_sysid.diagnosis.search.starts import best_per_effect
from motor_sysid.diagnosis.search.trial import Level, ONLY_NOISE, Trial
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.threads import in_threads

ALTERNATIVE = 0.8
"""Share of an effect's gain that another one must promise to be tried in its place."""

PROMISING = 0.97
"""Share of the best rough gain of a pair that another pair must reach to be fitted in full."""


State = tuple[frozenset[str], SpeedSensor]
"""What a fit is told from others by: its effects, and how the speed is measured."""


def state_of(model: Model) -> State:
    """Return what a model is told from others by."""
    return frozenset(model.effects), model.speed_sensor


@dataclass(frozen=True)
class Exchange:
    """Looks for better sets of effects.

    Attributes
    ----------
    bench:
        The data.
    seen:
        Models that were fitted and scored.
    tried:
        What was tried on them.
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
    seen: dict[State, tuple[Rung, Scores]]
    tried: Mapping[State, Sequence[Trial]]
    gains: dict[str, float]
    compared: dict[tuple[str, str], Compared]
    score: Callable[[Rung], Scores]
    tell: Callable[[str], None]

    def better(
        self, rung: Rung, start: Sequence[str], rivals: dict[str, tuple[str, ...]]
    ) -> Rung | None:
        """Return a better model in which one effect gives way to another one, or to two.

        What is superfluous then has gone; none is returned that comes to an effect at the limit
        of what makes sense, which would not be added alone either.  Another effect that does as
        well is noted in `rivals`.
        """
        other = self.found(rung, start, rivals)
        if other is None:
            return None
        other = pruned(other, self.bench, self.gains, self.tell, last=True)
        new = set(other.model.effects) - set(rung.model.effects)
        duration = self.bench.scales.duration
        return None if any(senseless(other.model, key, duration) for key in new) else other

    def found(
        self, rung: Rung, start: Sequence[str], rivals: dict[str, tuple[str, ...]]
    ) -> Rung | None:
        """Return what `better` looks at."""
        own = [key for key in rung.model.effects if key not in start]
        other = self.asked_again(rung, own[:-1], rivals)
        if other is not None:
            return other
        weighting = self.seen[state_of(rung.model)][1].weighting
        cost, rows = profile_cost(rung, self.bench, weighting)
        left = cost - ONLY_NOISE * rows
        blind = [key for key in own if self.chosen_blindly(key, rung)]
        least = {key: RIVAL_SHARE * self.gains.get(key, 0.0) for key in own}
        doubtful = [key for key in own if key in blind or left > max(least[key], 0.0)]
        doubtful = [key for key in doubtful if not self.bench.shows(key)]
        if not doubtful:
            return None
        begun = [now for (keys, _), now in self.seen.items() if keys == frozenset(start)]
        first = begun[-1][1].pairs
        if first and {one.variant.effect.key for one in first[0]} == set(own):
            return None
        for key in doubtful:
            slim, scores = self.without(rung, key)
            level = Level.of(slim, self.bench, scores.weighting)
            mine = level.gain(rung, self.bench)
            if len(own) > 1 or key in blind:
                for trial in self.substitutes(key, level, scores, mine):
                    if _spoils(trial.rung, rung):
                        continue
                    if trial.delta_bic > mine + max(RIVAL_BIC, RIVAL_SHARE * mine) or (
                        key in blind and runs_clearly_better(trial.rung, rung)
                    ):
                        return self.exchanged(key, trial, rung)
                    found = compared(slim, rung, trial.rung)
                    if not alike(found):
                        continue
                    if trial.key not in rivals.get(key, ()):
                        rivals[key] = (*rivals.get(key, ()), trial.key)
                    self.compared[key, trial.key] = found
            better = self.best_pair(key, level, scores, mine, rivals)
            if better is not None and _runs_better(better, rung, key):
                return climb(better.model, self.bench, rung.result.weighting)
        return None

    def asked_again(
        self, rung: Rung, keys: Sequence[str], rivals: dict[str, tuple[str, ...]]
    ) -> Rung | None:
        """Ask the rivals of what was added early again, now that the rest is there.

        What was still missing then may have favoured either.  A rival that has fallen behind is
        no longer one; the model with a rival that has got ahead is returned.  What held-out data
        `favoured` is asked as well, though it was none.
        """
        ahead: list[tuple[float, str, Trial]] = []
        for key in keys:
            favoured = [] if self.bench.shows(key) else self.favoured(key, rung)
            if not rivals.get(key) and not favoured:
                continue
            slim, scores = self.without(rung, key)
            level = Level.of(slim, self.bench, scores.weighting)
            after = profile_cost(rung, self.bench, scores.weighting)[0]
            mine = level.gain(rung, self.bench)
            margin = margin_of(mine, after / level.rows)
            trials = {name: self.trial(name, level, scores) for name in rivals.get(key, ())}
            if key in rivals:
                rivals[key] = tuple(
                    name
                    for name, trial in trials.items()
                    if trial is None or (may_rival(trial) and trial.delta_bic > mine - margin)
                )
            begun = [t for t in favoured if t.key not in trials]
            others = [settled(_beside(t, slim), level, self.bench) for t in begun]
            found = [t for t in (*trials.values(), *others) if t and t.passes]
            found = [t for t in found if not _spoils(t.rung, rung)]
            ahead += [(t.delta_bic - mine, key, t) for t in found if t.delta_bic > mine + margin]
        if not ahead:
            return None
        _, key, trial = max(ahead, key=lambda one: one[0])
        rivals.pop(key, None)
        return self.exchanged(key, trial, rung)

    def favoured(self, key: str, rung: Rung) -> list[Trial]:
        """Return what held-out data spoke for more, where an effect of a fit was added.

        As it was tried then: what was still missing may have made the effect the better one in
        the training data.
        """
        found: dict[str, Trial] = {}
        for trials in self.tried.values():
            mine = next((t for t in trials if t.key == key and t.passes), None)
            if mine is None:
                continue
            for t in trials:
                near = t.passes and t.delta_bic > ALTERNATIVE * mine.delta_bic
                if near and t.gain_percent > mine.gain_percent and not related(t, mine):
                    found.setdefault(t.key, t)
        return [t for name, t in found.items() if _goes_with(name, rung.model.effects)]

    def exchanged(self, key: str, trial: Trial, rung: Rung) -> Rung:
        """Return the fit in which what was tried has taken the place of an effect."""
        self.tell(f'{titles([trial.key])} does better than {titles([key])}')
        self.gains[trial.key] = trial.delta_bic
        return climb(trial.rung.model, self.bench, rung.result.weighting)

    def chosen_blindly(self, key: str, rung: Rung) -> bool:
        """Whether an effect was chosen while the speed sensor was thought to be another one.

        Counts have no room for an offset, say: a constant load was all that could explain it.
        What every motor has goes before all else, whatever the sensor.
        """
        if is_usual(effect(key), rung.model):
            return False
        effects, sensor = state_of(rung.model.without_effect(key))
        sensors = {measured for keys, measured in self.seen if keys == effects}
        return bool(sensors) and sensor not in sensors

    def without(self, rung: Rung, key: str) -> tuple[Rung, Scores]:
        """Return the fit without one effect, and what then scores."""
        model = rung.model.without_effect(key)
        if state_of(model) not in self.seen:
            self.score(climb(model, self.bench, rung.result.weighting))
        return self.seen[state_of(model)]

    def trial(self, key: str, level: Level, scores: Scores) -> Trial | None:
        """Return an effect tried on a model; None where the model cannot have it.

        Where it was fitted on other models before, a fit begins as it ended there, too.
        """
        known = self.known(level).get(key)
        if known is not None and known.rung is not level.rung:
            return settled(known, level, self.bench)
        starts = [s for s in scores.singles if s.variant.effect.key == key]
        if not starts:
            return None
        trials = [try_effect(best_per_effect(starts, 1)[0], level, self.bench)]
        fitted = [
            t for each in self.tried.values() for t in each
            if t.key == key and key in t.rung.model.effects
        ]  # fmt: skip
        if fitted and not starts[0].variant.inherits:
            trials.append(settled(_beside(fitted[-1], level.rung), level, self.bench))
        return max(trials, key=lambda one: one.delta_bic)

    def known(self, level: Level) -> dict[str, Trial]:
        """Return what was tried on a model when it was climbed to, by key."""
        return {trial.key: trial for trial in self.tried.get(state_of(level.rung.model), ())}

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
        rough = in_threads(lambda pair: try_pair(pair, level, self.bench), worth)
        tried = [(*fitted, pair) for fitted, pair in zip(rough, worth, strict=True)]
        near = max(PROMISING * max((one[1] for one in tried), default=0.0), gain)
        fits = in_threads(
            lambda one: (*settled_pair(one[0], level, self.bench), one[2]),
            [one for one in tried if one[1] > near],
        )
        duration = self.bench.scales.duration
        tried = [
            one
            for one in fits
            if not any(
                is_impossible(one[0].model, part.variant.effect.key, duration) for part in one[2]
            )
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
                self.compared[mine, theirs] = compared(slim, tried[0][0], fitted)
        self.tell(f'{titles(sorted(best))} together do better than {titles([key])}')
        self.gains.update(dict.fromkeys(best, tried[0][1]))
        return tried[0][0]

    def substitutes(
        self, key: str, level: Level, scores: Scores, gain: float
    ) -> Iterator[Trial]:
        """Yield what explains the data as well as an effect that was taken out, or better.

        What was fitted there before counts by its fit, all else by its score.
        """
        related = {key, *effect(key).card.generalises}
        promises: dict[str, float] = {}
        for one in scores.singles:
            other = one.variant.effect
            if other.key not in related and key not in other.card.generalises:
                promises.setdefault(other.key, one.delta_bic)
        known = self.known(level).items()
        promises |= {name: t.delta_bic for name, t in known if name in promises}
        for name in sorted(promises, key=lambda name: -promises[name])[:2]:
            if promises[name] > ALTERNATIVE * gain:
                trial = self.trial(name, level, scores)
                if trial and trial.passes and trial.delta_bic > gain - RIVAL_BIC:
                    yield trial


def _spoils(other: Rung, rung: Rung) -> bool:
    """Whether another fit does worse on held-out data, whatever the training data say of it."""
    return other.held.error_percent > SPOILED * rung.held.error_percent


def _runs_better(pair: Rung, rung: Rung, key: str) -> bool:
    """Whether a pair in the place of an effect lowers the held-out error.

    One that holds the effect itself only adds the other: that must pass what a further one must.
    """
    least = MIN_FURTHER_GAIN_PERCENT if key in pair.model.effects else 0.0
    return pair.held.error_percent < (1 - least / 100) * rung.held.error_percent


def _goes_with(key: str, others: Sequence[str]) -> bool:
    """Whether an effect is none of some others, nor takes the place of any or any its own."""
    wide = set(effect(key).card.replaces)
    return all(
        key != one and one not in wide and key not in effect(one).card.replaces
        for one in others
    )


def _beside(trial: Trial, rung: Rung) -> Trial:
    """Return a trial as it was fitted on another model, with the effects of this one alone."""
    model = trial.rung.model
    for key in model.effects:
        if key != trial.key and key not in rung.model.effects:
            model = model.without_effect(key)
    for key in rung.model.effects:
        if key not in model.effects and model.lacks(effect(key)):
            values = {name: one[0] for name, one in parameters_of(rung.model, key).items()}
            model = model.with_effect(key, values)
    model = model.with_speed_sensor(rung.model.speed_sensor)
    return replace(trial, rung=replace(rung, result=replace(rung.result, model=model), near=()))
