"""The pipeline: score, refit, gate, add, prune until nothing helps; then the verdict."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from motor_sysid.diagnosis.candidates.score import Scores
from motor_sysid.diagnosis.experiment.next_experiment import next_experiment
from motor_sysid.diagnosis.result.names import titles
from motor_sysid.diagnosis.result.result import Diagnosis, Verdict
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.confusable import Compared
from motor_sysid.diagnosis.search.delay_walk import walked
from motor_sysid.diagnosis.search.exchange import Exchange, State, state_of
from motor_sysid.diagnosis.search.feedback import unbiased
from motor_sysid.diagnosis.search.gates import is_doubted, MIN_FURTHER_GAIN_PERCENT
from motor_sysid.diagnosis.search.integration_steps import asked_finer, exact, refined
from motor_sysid.diagnosis.search.needless import why_needless
from motor_sysid.diagnosis.search.pairs import beginning, best_twosome, TWO
from motor_sysid.diagnosis.search.pits import deepest
from motor_sysid.diagnosis.search.polish import polish
from motor_sysid.diagnosis.search.prune import led_out, pruned, relieved
from motor_sysid.diagnosis.search.ranking import (
    chosen,
    doubts,
    holds_its_own,
    rivals_alone,
    rivals_left,
    rivals_of,
)
from motor_sysid.diagnosis.search.retelling import retold
from motor_sysid.diagnosis.search.rounds import (
    accounted,
    explains,
    led_back,
    outdone,
    refitted,
    scored,
    straightened,
    tried_instead,
    unseen,
)
from motor_sysid.diagnosis.search.rung import (
    ASTRAY,
    climb,
    Rung,
    SPOILED,
    with_better_sensor,
)
from motor_sysid.diagnosis.search.sense import is_nonsense
from motor_sysid.diagnosis.search.step_ahead import in_its_place, refused, second_of, steps_from
from motor_sysid.diagnosis.search.strides import freed
from motor_sysid.diagnosis.search.trial import Ladder, Trial
from motor_sysid.diagnosis.settings import Settings
from motor_sysid.diagnosis.verdict.blind_spots import input_is_constant
from motor_sysid.diagnosis.verdict.evidence import as_trifles, notes_of, steps_of
from motor_sysid.diagnosis.verdict.explain import explained
from motor_sysid.diagnosis.verdict.left_over import left_over
from motor_sysid.diagnosis.verdict.verdict import (
    besides,
    contested,
    last_goes,
    verdict_of,
)
from motor_sysid.diagnosis.where.remainder import Remainder
from motor_sysid.effort import is_spent
from motor_sysid.estimation.batch import Weighting
from motor_sysid.physics.effect import Effect

Progress = Callable[[str], None]
Rivals = dict[str, tuple[str, ...]]


class Engine:
    """One diagnosis on its way."""

    def __init__(
        self,
        bench: Bench,
        candidates: Sequence[Effect],
        settings: Settings,
        tell: Progress,
        nominal: Mapping[str, float],
    ) -> None:
        self.bench, self.settings, self.tell, self.nominal = bench, settings, tell, nominal
        self.candidates = [
            c for c in candidates if bench.filtered is not False or not c.filters_speed
        ]
        self.gains: dict[str, float] = {}
        self.compared: dict[tuple[str, str], Compared] = {}
        self.notes: list[str] = []
        self.seen: dict[State, tuple[Rung, Scores]] = {}
        self.tried: dict[State, list[Trial]] = {}
        self.train_records = [
            r for r, role in zip(bench.records, bench.roles, strict=True) if role == 'train'
        ]

    def run(self, rung: Rung) -> Diagnosis:
        """Climb until nothing helps; begin again with two effects where that leads nowhere.

        A motor with laws of its own is followed in fine enough steps from the start: what steps do
        wrong would look like whatever takes finer ones.
        """
        if rung.model.kind.own:
            rung, self.bench = refined(rung, self.bench)
        bench = self.bench
        ladder, rivals = self.climb([], rung)
        shown, (base, first) = beginning(ladder, bench)
        found = self.finish(ladder, rivals)
        unknown = found.verdict is Verdict.UNKNOWN_EFFECT
        if not unknown or self.settings.max_effects < TWO or is_spent():
            return found
        self.bench = bench
        pair = best_twosome(base, self.seen[state_of(base.model)][1], bench, self.tell)
        if pair is None:
            return found
        rung, gain, alone = pair
        own = [key for key in rung.model.effects if key not in base.model.effects]
        begun = [*shown, (base, alone + [t for t in first if not alone or t.key not in own])]
        self.gains |= dict.fromkeys(own, gain)
        self.notes = []
        ladder, rivals = self.climb(begun, self.refine(rung))
        again = self.finish(ladder, rivals_alone(ladder) | rivals)
        return again if again.verdict in (Verdict.EFFECT_MISSING, Verdict.AMBIGUOUS) else found

    def climb(self, begun: Ladder, rung: Rung) -> tuple[Ladder, Rivals]:
        """Add effects one by one to a fit until nothing helps, on top of a ladder `begun`.

        Returns
        -------
        What was fitted, each with what was tried on it, and who does as well as each effect.
        """
        ladder, rivals = list(begun), dict[str, tuple[str, ...]]()
        start = ladder[0][0].model.effects if ladder else rung.model.effects
        reconsidered = False
        for _ in range(2 * self.settings.max_effects + 2):
            rung, trials = self.round(rung, ladder[0][0] if ladder else None)
            if ladder and ladder[-1][0].model.effects == rung.model.effects:
                ladder.pop()  # what was added on it has proved superfluous
            ladder.append((rung, trials))
            helps = any(t.passes for t in trials)
            tired = (len(ladder) > 1 or not helps) and is_spent()
            if tired or len(ladder) > self.settings.max_effects:
                break
            if not helps:
                held_back = refused(rung, trials, self.bench)
                finer, self.bench = asked_finer(rung, held_back, self.bench)
                if finer is not rung:
                    self.tell(f'asking again in {self.bench.substeps} steps a sample')
                    rung = finer
                    continue
                other = None if reconsidered else self.exchange().better(rung, start, rivals)
                if other is not None:
                    rung, reconsidered = self.refine(other), True
                    continue
                room = len(ladder) < self.settings.max_effects and not explains(rung, ladder[0][0])
                step = self.ahead(rung, trials, ladder[0][0], rivals) if room else None
                if step is None:
                    break
                rung, trials = step
                if not trials:
                    rung = self.refine(rung)
                    continue
                ladder.append(step)
            rung = self.added(rung, trials, rivals)
        return ladder, rivals

    def added(self, rung: Rung, trials: Sequence[Trial], rivals: Rivals) -> Rung:
        """Return the fit with the best that passes, without what it has made superfluous.

        What else does as well is noted in `rivals`.
        """
        winner, equals = chosen(trials, rung, filtered=self.bench.filtered)
        rivals[winner.key] = equals
        self.gains[winner.key] = winner.delta_bic
        self.tell(
            f'adding {winner.scored.variant.effect.card.title}: held-out error '
            f'{rung.validation.error_percent:.3g} -> '
            f'{winner.rung.validation.error_percent:.3g} %'
        )
        weighting = winner.rung.result.weighting
        best, _ = deepest(climb(winner.rung.model, self.bench, weighting), self.bench)
        worse = best.held.error_percent > SPOILED * winner.rung.held.error_percent
        worse = worse or is_nonsense(best.model, winner.key, self.bench.scales.duration)
        best = pruned(winner.rung if worse else best, self.bench, self.gains, self.tell)
        best = led_out(best, rung, self.bench, self.tell)
        return freed(self.refine(best), self.bench)

    def finish(self, ladder: Ladder, rivals: Rivals) -> Diagnosis:
        """Fit what a climb came to exactly, and give the verdict.

        The last of several effects goes if more is left than it takes away, or it is not told.
        """
        start = ladder[0][0].model.effects
        self.settle(ladder, start)
        doubted = self.doubted(ladder, start)
        left = left_over(ladder[-1][0], self.bench, self.train_records)
        while last_goes(ladder, left):
            self.take_back(ladder, start)
            left = left_over(ladder[-1][0], self.bench, self.train_records)
        return self.conclude(ladder, rivals, left, doubted=doubted)

    def take_back(self, ladder: Ladder, start: Sequence[str]) -> None:
        """Take back the last effect of several, and say so."""
        last = ladder.pop()[0].model.effects[-1]
        self.notes.append(
            f'{titles([last])} would explain a part of what remains, but not enough to '
            'be named: something else is missing, too'
        )
        self.settle(ladder, start)

    def doubted(self, ladder: Ladder, start: Sequence[str]) -> bool:
        """Whether others explain too much on top of all effects; if of the last alone, it goes."""
        (base, first), (last, trials) = ladder[0], ladder[-1]
        own = {key: gain for key, gain in self.gains.items() if key in last.model.effects}
        found = doubts(trials, own)
        if own and outdone(first, base, last, self.bench, self.weighting(base)):
            return True
        further = len(last.model.effects) > len(start) + 1 and last.model.effects[-1] in found
        if not further or holds_its_own(last, ladder[-2][0], trials):
            return len(found) == len(own) > 0
        self.take_back(ladder, start)
        return False

    def round(
        self, rung: Rung, base: Rung | None, *, thorough: bool = True
    ) -> tuple[Rung, list[Trial]]:
        """Score every candidate and refit the best; return what they were added to, and them.

        `base` is the fit without effects, once there are some; `thorough` as in `refitted`.
        Another speed sensor that errors speak against (where much is missing, the noise model
        knows little of what is noise) is taken only where nothing helps with this one, and
        something with the other helps more than that sensor alone does harm.
        """
        scores = self.score(rung)
        other = with_better_sensor(rung, self.bench, scores.weighting, scores.singles)
        doubtful = other.held.error_percent > SPOILED * rung.held.error_percent or (
            ASTRAY * other.training.error_percent > rung.training.error_percent
        )
        if other is not rung and not doubtful:
            rung, scores = self.seen_by(other)
        trials = self.refits(scores, rung, base, thorough=thorough)
        better = led_back(trials, rung, self.bench, scores.weighting)
        if better is not rung:
            self.tell('the fit had gone astray: beginning again where a trial ended')
            rung = better
            trials = self.refits(self.score(better), better, base, thorough=thorough)
        if doubtful and not any(t.passes for t in trials) and not is_spent():
            other, scores = self.seen_by(other)
            further = self.refits(scores, other, base, thorough=thorough)
            least = (1 - MIN_FURTHER_GAIN_PERCENT / 100) * rung.held.error_percent
            if any(t.passes and t.rung.held.error_percent < least for t in further):
                rung, trials = other, further
        self.tried[state_of(rung.model)] = trials
        return rung, trials

    def refits(
        self, scores: Scores, rung: Rung, base: Rung | None, *, thorough: bool
    ) -> list[Trial]:
        """Refit the best candidates on a fitted model; see `round`."""
        earlier = tried_instead(rung, (t for trials in self.tried.values() for t in trials))
        limit, tell = self.settings.refits, self.tell
        return refitted(scores, rung, self.bench, limit, tell, base, earlier, thorough=thorough)

    def seen_by(self, rung: Rung) -> tuple[Rung, Scores]:
        """Score every candidate on a fit with another speed sensor."""
        self.tell(f'taking the speed as {rung.model.speed_sensor.value}')
        return rung, self.score(rung)

    def refine(self, rung: Rung) -> Rung:
        """Return a fit out of pits, in fine enough steps, without what is superfluous there."""
        finer, self.bench = refined(*walked(rung, self.bench))
        if finer is rung:
            return rung
        return pruned(finer, self.bench, self.gains, self.tell, last=True)

    def ahead(
        self, rung: Rung, trials: Sequence[Trial], base: Rung, rivals: Rivals
    ) -> tuple[Rung, list[Trial]] | None:
        """Return a fit with an effect that does not pass alone, and what passes on top of it.

        What else does as well as that effect is noted in `rivals`.  Where nothing passes on top,
        but the effect does better than what was there before it, the fit with it alone is
        returned, and nothing.
        """
        possible = steps_from(rung, trials, self.bench, self.weighting(rung))
        for k, first in enumerate(possible):
            if is_spent():
                break
            self.tell(f'looking beyond {first.scored.variant.effect.card.title}')
            new = climb(first.rung.model, self.bench, first.rung.result.weighting, briefly=True)
            fitted, further = self.round(new, base, thorough=False)
            second = second_of(further, rung)
            if second is not None:
                self.gains[first.key] = first.delta_bic
                rivals[first.key] = rivals_of(first, possible[k:], rung)
                return fitted, [replace(t, note='') if t is second else t for t in further]
            alone = in_its_place(
                fitted, first, rung, self.bench, self.weighting(rung), self.gains, self.tell
            )
            if alone is not None:
                return alone, []
        return None

    def settle(self, ladder: Ladder, start: Sequence[str]) -> None:
        """Fit the last model exactly, and take back what then is nothing, or next to it."""
        while len(ladder) > 1:
            rung, trials = ladder[-1]
            lighter = relieved(ladder, self.bench, start, self.tell)
            if lighter is not rung:
                self.put_last(lighter, ladder)
                continue
            last, bench = exact(rung, self.bench)
            key, before = last.model.effects[-1], ladder[-2][0]
            if why := why_needless(last, before, bench):
                ladder.pop()
                self.notes.append(f'{titles([key])} would explain a little more, but {why}')
                continue
            own = set(last.model.effects) - set(start)
            if any(is_doubted(last.model, one) for one in own):
                slim = pruned(last, bench, self.gains, self.tell, last=True)
                if slim is not last:
                    self.put_last(slim, ladder)
                    continue
            self.bench = bench
            ladder[-1] = polish(last, bench), trials
            break

    def put_last(self, slim: Rung, ladder: Ladder) -> None:
        """Put a fit with fewer effects in the place of the last one."""
        if set(slim.model.effects) <= set(ladder[-2][0].model.effects):
            ladder.pop()
        else:
            ladder[-1] = self.round(slim, ladder[0][0])

    def score(self, rung: Rung) -> Scores:
        """Score every candidate on a fitted model."""
        scores = scored(rung, self.bench, self.candidates, self.tell)
        if not self.seen:
            self.candidates = [c for c in self.candidates if c.key not in unseen(scores)]
        self.seen[state_of(rung.model)] = rung, scores
        return scores

    def exchange(self) -> Exchange:
        """Return what looks for better sets of effects, as things stand."""
        return Exchange(
            self.bench, self.seen, self.tried, self.gains, self.compared, self.score, self.tell
        )

    def conclude(
        self, ladder: Ladder, rivals: Rivals, left: Remainder, *, doubted: bool = False
    ) -> Diagnosis:
        """Give the verdict on a finished ladder and what its last model has `left`."""
        ladder = straightened(ladder, self.bench.threshold)
        scored = (one for _, scores in self.seen.values() for one in scores.singles)
        ladder = retold(ladder, self.bench, self.weighting(ladder[-1][0]), scored)
        final = ladder[-1][0]
        units = self.train_records[0].units
        noise = {units[name]: sigma for name, sigma in left.floor.items()}
        rivals = rivals_left(rivals, final.model, noise)
        verdict = verdict_of(ladder, left, rivals, self.accounted(ladder), doubted)
        if verdict is Verdict.COMPLETE and input_is_constant(self.train_records):
            verdict = Verdict.INSUFFICIENT_DATA
        torn = contested(ladder[-1][1], final, self.bench.threshold)
        if verdict is Verdict.COMPLETE and torn:
            verdict = Verdict.UNKNOWN_EFFECT
        if verdict is Verdict.COMPLETE and len(ladder) == 1:
            ladder = [(unbiased(final, self.bench), ladder[0][1])]
        named = verdict in (Verdict.EFFECT_MISSING, Verdict.AMBIGUOUS)
        steps = steps_of(ladder, rivals, self.bench)
        shown = steps if named else steps[:1]
        if verdict is Verdict.COMPLETE:
            shown = (as_trifles(shown[0]),)
        known = ladder[0][0].model.effects
        found = Diagnosis(
            verdict=verdict,
            effects=tuple(key for key in final.model.effects if key not in known and named),
            steps=shown,
            noise_floor_percent=left.floor_percent,
            noise_sigma=left.floor,
            reasons=(),
            records=self.bench.records,
            roles=self.bench.roles,
            warnings=(*notes_of(ladder, self.bench, named=named), *self.notes)
            + ((besides(torn, final),) if named and torn else ()),
        )
        found = explained(found, steps, left, rivals, self.nominal, self.compared)
        wanted = next_experiment(verdict, ladder, rivals, self.train_records)
        return replace(found, experiment=wanted) if wanted else found

    def accounted(self, ladder: Sequence[tuple[Rung, list[Trial]]]) -> float:
        """Return the share of what is beyond noise that the last model explains."""
        base, last = ladder[0][0], ladder[-1][0]
        return accounted(base, last, self.bench, self.weighting(last))

    def weighting(self, rung: Rung) -> Weighting:
        """Return the noise model that the whole dictionary leaves on a model that was scored."""
        return self.seen[state_of(rung.model)][1].weighting
