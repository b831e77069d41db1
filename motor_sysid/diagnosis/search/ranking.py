"""Who wins a round, who does as well, and what is doubted of what was added."""

from collections.abc import Mapping, Sequence

import numpy as np

from motor_sysid.diagnosis.search.confusable import alike, compared
from motor_sysid.diagnosis.search.gain import gain_percent
from motor_sysid.diagnosis.search.gates import (
    is_usual,
    MIN_GAIN_PERCENT,
    TOO_LITTLE,
    UNCERTAIN,
    UNPHYSICAL,
)
from motor_sysid.diagnosis.search.rung import Rung
from motor_sysid.diagnosis.search.sense import is_lowest, LOWEST
from motor_sysid.diagnosis.search.synonyms import is_other_name
from motor_sysid.diagnosis.search.trial import Ladder, Trial
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

RIVAL_BIC = 10.0
RIVAL_SHARE = 0.02
AT_NOISE = 1.1
"""A rival is as good if its BIC is within 10; or within 2 % of the winner's gain, where even the
winner leaves more than noise: what remains may then favour either of them by chance.  So may what
no law has right to the last detail, where the gain is lost in the noise of the sensors."""

SPECIAL_SHARE = 0.5
"""A special case goes first if it explains this share of what its generalisation explains."""

LEFT_OVER = 0.2
"""Share of an effect's gain that nothing else may explain on top of it, or it is not named: what
is there leaves little to others, and a wrong neighbour of it leaves much."""

HARMS = -1.0
"""Fall of the held-out error, %, below which what is tried on top of an effect explains nothing,
whatever its evidence: laws that are a little wrong leave traces in the noise that others fit."""

NEARLY_ALL = 0.95
"""Share of the squared error beyond noise, whitened or plain, that the truth explains: a wrong
neighbour leaves more, and what explains more is not doubted."""


def chosen(
    trials: Sequence[Trial], rung: Rung, *, filtered: bool | None = None
) -> tuple[Trial, tuple[str, ...]]:
    """Return the trial that wins a round, one of which passes, and what does as well.

    Nothing does as well as a filter of the speed where the speed is `filtered`, as a position
    beside it tells.
    """
    winner = winner_of([t for t in trials if t.passes], filtered=filtered)
    if filtered and winner.scored.variant.effect.filters_speed:
        return winner, ()
    return winner, rivals_of(winner, [t for t in trials if may_rival(t, winner)], rung)


def winner_of(passing: Sequence[Trial], *, filtered: bool | None = None) -> Trial:
    """Return the best trial, or its simplest special case that explains most of it.

    Of several that do as well, what every motor has goes first, then one that keeps what the
    model has, then what the held-out data clearly speak for.  Before all of them goes a filter of
    the speed where that is known to be `filtered`.
    """
    shown = (t for t in passing if filtered and t.scored.variant.effect.filters_speed)
    if first := next(shown, None):
        return first
    best = passing[0]
    simplest = _simplest(best, passing)
    if simplest is not best:
        return simplest
    better = _run_better(best, passing)
    equal = [*better, best, *(t for t in _equals(best, passing) if t not in better)]
    if usual := next((t for t in equal if _usual(t)), None):
        return usual
    equal = [t for t in equal if _usual(t) is not False] or equal
    keeps = [t for t in equal if not t.scored.variant.inherits]
    return _simplest(keeps[0], passing) if keeps else equal[0]


def _run_better(best: Trial, passing: Sequence[Trial]) -> list[Trial]:
    """Return what has nearly as much evidence as the best, and runs clearly better.

    Where more is missing, a noise model takes some of that for noise, and small differences of
    evidence say little.
    """
    equals = _equals(best, passing, np.inf)
    better = [t for t in equals if _runs_clearly_better(t, best)]
    return sorted(better, key=lambda t: -t.gain_percent)


def _runs_clearly_better(one: Trial, other: Trial) -> bool:
    """Whether a trial leaves a held-out error that is lower by more than a hundredth."""
    return 100 - one.gain_percent < (1 - MIN_GAIN_PERCENT / 100) * (100 - other.gain_percent)


def _usual(trial: Trial) -> bool | None:
    return is_usual(trial.scored.variant.effect, trial.rung.model)


def _simplest(trial: Trial, passing: Sequence[Trial]) -> Trial:
    """Return the end of the chain of special cases, each of which explains most of the last.

    Or any of it, where a shape of the wider law lies on its lower bound: it tells of no more.
    """
    covered = trial.scored.variant.effect.card.generalises
    enough = -np.inf if is_special(trial) else SPECIAL_SHARE * trial.delta_bic
    special = next((t for t in passing if t.key in covered and t.delta_bic > enough), None)
    return trial if special is None else _simplest(special, passing)


def is_special(trial: Trial) -> bool:
    """Whether a shape lies on its lower bound: bristles that do not bend, say."""
    names = [f'{trial.key}.{shape.name}' for shape in trial.scored.variant.effect.card.shapes]
    own = [trial.rung.model.parameters[n] for n in names if n in trial.rung.model.parameters]
    return any(map(is_lowest, own))


def may_rival(trial: Trial, winner: Trial | None = None) -> bool:
    """Whether a trial may be a rival: it passes, or only its size is uncertain.

    Or only the held-out data keep it out, and they say next to nothing for the winner against it:
    there the training data decide.
    """
    if trial.passes or trial.note == UNCERTAIN:
        return True
    kept_out = trial.note.startswith(TOO_LITTLE) and trial.gain_percent > 0.0
    return winner is not None and kept_out and not _runs_clearly_better(winner, trial)


def rivals_of(winner: Trial, trials: Sequence[Trial], base: Rung) -> tuple[str, ...]:
    """Return the effects that explain the data as well as the winner does.

    One that comes to the same law is none: no experiment tells the two apart, and no question is
    open.  Nor is one that changes other things in the outputs of `base`: it is missing as well.
    What every motor has, has no rivals, and is none if it would have to be larger than usual.
    """
    equals = [t for t in _equals(winner, trials) if not same_law(t, winner)]
    equals = [t for t in equals if _usual(t) is not False]
    if _usual(winner):
        return ()
    if _is_lost(winner):
        return tuple(t.key for t in equals)
    return tuple(t.key for t in equals if alike(compared(base, winner.rung, t.rung)))


def rivals_alone(ladder: Ladder) -> dict[str, tuple[str, ...]]:
    """Return the rivals of an effect to which a second climb has come by way of a pair.

    Those that did as well alone on the model without effects; none where more than one is left.
    """
    (base, trials), (last, _) = ladder[0], ladder[-1]
    own = set(last.model.effects) - set(base.model.effects)
    mine = next((t for t in trials if {t.key} == own and may_rival(t)), None)
    others = [t for t in trials if may_rival(t)]
    return {mine.key: rivals_of(mine, others, base)} if mine else {}


def rivals_left(
    rivals: Mapping[str, Sequence[str]], model: Model, noise: Mapping[str, float]
) -> dict[str, tuple[str, ...]]:
    """Return the rivals that the effects of the last model have, none of which it has.

    Where what a law adds to a special case is too small to be seen, that is one: a dead time whose
    ripple of current is on its lower bound, or below the `noise` of the sensor (unit to standard
    deviation), may as well be brushes.  A special case has the rivals of the effect whose place it
    took.
    """
    found: dict[str, tuple[str, ...]] = {}
    for key in model.effects:
        gone = [one for one in rivals if one not in model.effects]
        wider = [one for one in gone if key in effect(one).card.generalises]
        known = [name for one in ([key] if key in rivals else wider) for name in rivals[one]]
        known = [name for name in known if not _widens(name, key) and not _widens(key, name)]
        names = [*known, *_unseen(model, key, noise)]
        if key in rivals or names:
            found[key] = tuple(n for n in dict.fromkeys(names) if n not in model.effects)
    return found


def _unseen(model: Model, key: str, noise: Mapping[str, float]) -> list[str]:
    """Return the special cases from which an effect differs by shapes alone that are not seen."""
    card, found = effect(key).card, []
    for special, pairs in card.generalises.items():
        shared = {mine for mine, _ in pairs}
        if any(amplitude.name not in shared for amplitude in card.amplitudes):
            continue
        names = [f'{key}.{shape.name}' for shape in card.shapes if shape.name not in shared]
        own = [p for p in map(model.parameters.__getitem__, names) if p.free]
        small = [p.value <= max(LOWEST * p.lower, noise.get(p.unit, 0.0)) for p in own]
        if small and all(small) and model.admits(effect(special)):
            found.append(special)
    return found


def _is_lost(trial: Trial) -> bool:
    """Whether a gain is lost in the noise of the sensors, and what is changed with it."""
    return trial.gain_percent < MIN_GAIN_PERCENT


def _equals(
    best: Trial, passing: Sequence[Trial], excess: float | None = None
) -> list[Trial]:
    """Return the trials that do as well as the best, but for wider and narrower forms of it.

    `excess` is what the best one leaves, if that is known better than by its own noise model.
    """
    if excess is None:
        excess = np.inf if _is_lost(best) else best.excess
    least = best.delta_bic - margin_of(best.delta_bic, excess)
    others = [t for t in passing if t.key != best.key and not related(t, best)]
    return [t for t in others if t.delta_bic > least]


def margin_of(gain: float, excess: float) -> float:
    """Return how far in BIC a rival may be behind; `excess` is what the better one leaves."""
    return max(RIVAL_BIC, RIVAL_SHARE * gain) if excess > AT_NOISE else RIVAL_BIC


def related(one: Trial, other: Trial) -> bool:
    """Whether one of two trials is of a special case of the other's effect."""
    return _widens(one.key, other.key) or _widens(other.key, one.key)


def _widens(key: str, special: str) -> bool:
    return special in effect(key).card.generalises


def same_law(one: Trial, other: Trial) -> bool:
    """Whether two trials come to one law.

    Either it widens an effect of the model or is added to it, or it has two names.
    """
    return _completes(one.key, other) or _completes(other.key, one)


def _completes(key: str, trial: Trial) -> bool:
    variant = trial.scored.variant
    parts = variant.effect.card.sum_of
    if parts == (key,):
        return is_other_name(variant.effect, trial.rung.model)
    return variant.inherits and key in parts


def doubts(trials: Sequence[Trial], gains: Mapping[str, float]) -> list[str]:
    """Return the effects on top of which others would explain too much.

    Parameters
    ----------
    trials:
        What was tried on the last model.
    gains:
        Gain in BIC of each of the model's effects when it was added.
    """
    possible = [t for t in trials if t.note != UNPHYSICAL and t.gain_percent > HARMS]
    return [
        key
        for key, gain in gains.items()
        if any(
            t.delta_bic > LEFT_OVER * gain
            and t.key not in effect(key).card.generalises
            and key not in t.scored.variant.effect.card.generalises
            and t.scored.variant.effect.after != key
            for t in possible
        )
    ]


def holds_its_own(rung: Rung, without: Rung, trials: Sequence[Trial]) -> bool:
    """Whether nothing lowers the held-out error by a fifth of what the last effect did.

    Laws that are a little wrong leave evidence for others in training data that look alike.
    """
    gain = gain_percent(without.held, rung.held)
    possible = [t.gain_percent for t in trials if t.note != UNPHYSICAL]
    return max(possible, default=0.0) < LEFT_OVER * gain
