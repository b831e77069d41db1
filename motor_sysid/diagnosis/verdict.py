"""Who wins a round, who does as well, and what a finished ladder says."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from motor_sysid.diagnosis.apart import alike, compared
from motor_sysid.diagnosis.gate import (
    combined_error,
    gone,
    is_usual,
    MIN_GAIN_PERCENT,
    SURE,
    UNCERTAIN,
    UNPHYSICAL,
    UNSTEADY,
)
from motor_sysid.diagnosis.remainder import Remainder, TRIFLE_PERCENT
from motor_sysid.diagnosis.result import Verdict
from motor_sysid.diagnosis.rung import Rung
from motor_sysid.diagnosis.synonyms import is_other_name
from motor_sysid.diagnosis.trial import Trial
from motor_sysid.physics.effects import effect

RIVAL_BIC = 10.0
RIVAL_SHARE = 0.02
AT_NOISE = 1.1
"""A rival is as good if its BIC is within 10; or within 2 % of the winner's gain, where even the
winner leaves more than noise: what remains may then favour either of them by chance.  So may what
no law has right to the last detail, where the gain is lost in the noise of the sensors."""

SPECIAL_SHARE = 0.5
"""A special case goes first if it explains this share of what its generalisation explains."""

LOWEST = 1.01
"""A shape lies on its lower bound up to this multiple of it."""

LEFT_OVER = 0.2
"""Share of an effect's gain that nothing else may explain on top of it, or it is not named: what
is there leaves little to others, and a wrong neighbour of it leaves much."""

HARMS = -1.0
"""Fall of the held-out error, %, below which what is tried on top of an effect explains nothing,
whatever its evidence: laws that are a little wrong leave traces in the noise that others fit."""

NEARLY_ALL = 0.95
"""Share of the squared error beyond noise, whitened or plain, that the truth explains: a wrong
neighbour leaves more, and what explains more is not doubted."""

ALL_BUT_A_TRIFLE = 0.99
"""The same for several effects with which a friction of the motor turns out to be nothing: a law
may take in a little of it, and wrong ones do not explain so much together."""

FLOOR_SURE = 0.1
"""Relative error of the square of the sensor noise that is read from the data."""

EXPLAINED = 0.9
"""Share of the squared error beyond sensor noise that what is named must explain, where something
predictable remains or where base parameters are undetermined."""

FAINT = 0.02
"""Predictable share of the squared error below which next to nothing can be predicted."""

NOTICED = 1.1
"""Fall of the held-out error from which on an effect is no trifle, however small the error was."""

TOO_VAGUE = 2
"""Base parameters that may not be undetermined together, without and with what is named;
inductance alone often is."""


def winner_of(passing: Sequence[Trial]) -> Trial:
    """Return the best trial, or its simplest special case that explains most of it.

    Of several that do as well, what every motor has goes first, then one that keeps what the
    model has.
    """
    best = passing[0]
    simplest = _simplest(best, passing)
    if simplest is not best:
        return simplest
    equal = [best, *_equals(best, passing)]
    if usual := next((t for t in equal if _usual(t)), None):
        return usual
    equal = [t for t in equal if _usual(t) is not False] or equal
    keeps = [t for t in equal if not t.scored.variant.inherits]
    return _simplest(keeps[0], passing) if keeps else equal[0]


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
    return any(p.free and p.value <= LOWEST * p.lower for p in own)


def may_rival(trial: Trial) -> bool:
    """Whether a trial may be a rival: it passes, or only its size is uncertain."""
    return trial.passes or trial.note == UNCERTAIN


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


def _is_lost(trial: Trial) -> bool:
    """Whether a gain is lost in the noise of the sensors, and what is changed with it."""
    return trial.gain_percent < MIN_GAIN_PERCENT


def _equals(best: Trial, passing: Sequence[Trial]) -> list[Trial]:
    """Return the trials that do as well as the best, but for wider and narrower forms of it."""
    excess = np.inf if _is_lost(best) else best.excess
    least = best.delta_bic - margin_of(best.delta_bic, excess)
    others = [t for t in passing if t.key != best.key and not related(t, best)]
    return [t for t in others if t.delta_bic > least]


def margin_of(gain: float, excess: float) -> float:
    """Return how far in BIC a rival may be behind; `excess` is what the better one leaves."""
    return max(RIVAL_BIC, RIVAL_SHARE * gain) if excess > AT_NOISE else RIVAL_BIC


def related(one: Trial, other: Trial) -> bool:
    """Whether one of two trials is of a special case of the other's effect."""
    first, second = one.scored.variant.effect, other.scored.variant.effect
    return first.key in second.card.generalises or second.key in first.card.generalises


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
    gain = 100 * (1 - combined_error(rung.held, without.held))
    possible = [t.gain_percent for t in trials if t.note != UNPHYSICAL]
    return max(possible, default=0.0) < LEFT_OVER * gain


def _vague(rung: Rung) -> int:
    """Return how many base parameters are undetermined, of a combination all but one.

    A missing effect may push two of them to their bounds; with it, they come back.
    """
    base = [name for name in rung.result.undetermined if '.' not in name]
    said = [text for text in rung.result.unidentifiable if '.' not in text.split()[0]]
    return max(len(base) - 1, min(len(said), len(base)))


def _drops(ladder: Sequence[tuple[Rung, list[Trial]]]) -> list[float]:
    """Return the decrease of the squared held-out error by each of several effects, %^2."""
    rungs = [rung for rung, _ in ladder]
    drops = [
        before.held.error_percent**2 - after.held.error_percent**2
        for before, after in pairwise(rungs)
        if set(before.model.effects) < set(after.model.effects)
    ]
    return drops if len(drops) > 1 else []


def _outweighs(left: Remainder, final: Rung, drop: float) -> bool:
    """Whether more is left for certain, and of a shape, than an effect took away, %^2."""
    return left.structured and left.share * final.held.error_percent**2 > drop


def is_last_outweighed(ladder: Sequence[tuple[Rung, list[Trial]]], left: Remainder) -> bool:
    """Whether the last of several effects alone takes away less than what is left."""
    *others, last = _drops(ladder) or [np.inf]
    if not others or ladder[-1][0].model.effects[:-1] != ladder[-2][0].model.effects:
        return False
    final = ladder[-1][0]
    return _outweighs(left, final, last) and not _outweighs(left, final, min(others))


def contested(trials: Sequence[Trial], base: Rung, threshold: float) -> Trial | None:
    """Return what training data speak for beyond doubt and held-out data only in part, if any.

    That a model is complete cannot be said then, though nothing is named either: it lowers the
    held-out error by more than what is too small to matter, but not steadily, as waves over a turn
    do whose angle is not measured.
    """
    least = base.held.error_percent**2 - TRIFLE_PERCENT**2
    torn = [
        t for t in trials
        if t.note == UNSTEADY and t.delta_bic > SURE * threshold
        and t.rung.held.error_percent**2 < least
    ]  # fmt: skip
    return max(torn, key=lambda t: t.delta_bic, default=None)


def verdict_of(
    ladder: Sequence[tuple[Rung, list[Trial]]],
    left: Remainder,
    rivals: Mapping[str, tuple[str, ...]],
    accounted: float = 1.0,
    doubted: bool = False,
) -> Verdict:
    """Return what a ladder of fits, with what was tried on each, comes to.

    If the only effect is `doubted`, or leaves more that can be predicted than it explains, and
    does not explain nearly all, something is missing, but not that; nor is it what is named if
    that has not `accounted` for nearly all whitened squares beyond noise either.  Where all that
    the base model leaves beyond the noise is a trifle, and hardly falls, nothing is then missing.
    Of several effects none may take away less than the missing physics that is left, and none may
    leave nothing of a parameter of the motor that was well known, unless several explain all but a
    trifle.  Where base parameters are undetermined, what explains nearly all is named all the
    same.
    """
    base, final = ladder[0][0], ladder[-1][0]
    structured = left.structured
    before, after = base.held.error_percent**2, final.held.error_percent**2
    beyond = before - left.floor_percent**2
    explained = (before - after) / max(beyond, 1e-300)
    vague = min(_vague(base), _vague(final)) >= TOO_VAGUE
    if vague and not structured and (len(ladder) == 1 or explained < EXPLAINED):
        return Verdict.INSUFFICIENT_DATA
    if len(ladder) == 1:
        return Verdict.UNKNOWN_EFFECT if structured else Verdict.COMPLETE
    missing = min(left.predictable * after, left.beyond_percent**2)
    larger = left.predictable > FAINT and missing > before - after
    doubted = (doubted or larger) and explained < NEARLY_ALL
    surely = (before - after) / max(beyond + FLOOR_SURE * left.floor_percent**2, 1e-300)
    doubted = doubted or max(accounted, surely) < NEARLY_ALL
    trifle = beyond < TRIFLE_PERCENT**2 and before < NOTICED**2 * after
    if doubted and not structured and trifle:
        return Verdict.COMPLETE
    outweighed = _outweighs(left, final, min(_drops(ladder), default=np.inf))
    if (structured and explained < EXPLAINED) or outweighed or doubted:
        return Verdict.UNKNOWN_EFFECT
    several = len(final.model.effects) > len(base.model.effects) + 1
    believed = several and explained > ALL_BUT_A_TRIFLE
    if not believed and gone(final.model, base.model):
        return Verdict.UNKNOWN_EFFECT
    return Verdict.AMBIGUOUS if any(rivals.values()) else Verdict.EFFECT_MISSING
