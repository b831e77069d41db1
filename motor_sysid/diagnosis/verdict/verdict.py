"""What a finished ladder says."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from motor_sysid.diagnosis.result.result import Verdict
from motor_sysid.diagnosis.search.gates import (
    ALL_BUT_A_TRIFLE,
    gone,
    HELD_BACK,
    is_told,
    is_wild,
    SURE,
    UNSTEADY,
)
from motor_sysid.diagnosis.search.ranking import NEARLY_ALL
from motor_sysid.diagnosis.search.rung import Rung
from motor_sysid.diagnosis.search.trial import Trial
from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.diagnosis.where.remainder import Remainder, TRIFLE_PERCENT
from motor_sysid.physics.model import Model

FLOOR_SURE = 0.1
"""Relative error of the square of the sensor noise that is read from the data."""

EXPLAINED = 0.9
"""Share of the squared error beyond sensor noise that what is named must explain, where something
predictable remains (`NEARLY_ALL` of it if several are named: together they may stand for another
one) or where base parameters are undetermined."""

FAINT = 0.02
"""Predictable share of the squared error below which next to nothing can be predicted."""

NOTICED = 1.1
"""Fall of the held-out error from which on an effect is no trifle, however small the error was."""

LITTLE, HARDLY = 0.05, 1.01
"""Share of the squared error beyond sensor noise, and fall of the held-out error, below which what
was added is a trifle beside random loads and what a model's own laws leave, however large these
are."""

OF_TRAINING = 0.1
"""Share of the squared training error below which what goes of it tells of nothing."""

MOSTLY_NOISE = 20.0
"""Held-out error of an output in percent from which on noise makes much of what it shows."""

TOO_VAGUE = 2
"""Base parameters that may not be undetermined together, without and with what is named;
inductance alone often is."""


def _vague(rung: Rung) -> int:
    """Return how many base parameters are undetermined, of a combination all but one.

    A missing effect may push two of them to their bounds; with it, they come back.
    """
    base = [name for name in rung.result.undetermined if '.' not in name]
    said = [text for text in rung.result.unidentifiable if '.' not in text.split()[0]]
    return max(len(base) - 1, min(len(said), len(base)))


def _drops(ladder: Sequence[tuple[Rung, list[Trial]]]) -> list[float]:
    """Return the decrease of the squared held-out error by each of several effects, %^2.

    One that raises the error alone, and only leads to the next, is counted together with it.
    """
    drops, raised = [], 0.0
    for (before, _), (after, _) in pairwise(ladder):
        if not set(before.model.effects) < set(after.model.effects):
            raised = 0.0
            continue
        drop = before.held.error_percent**2 - after.held.error_percent**2 + raised
        raised = min(drop, 0.0)
        if not raised:
            drops.append(drop)
    drops += [raised] if raised else []
    return drops if len(drops) > 1 else []


def _outweighs(left: Remainder, final: Rung, drop: float) -> bool:
    """Whether more is left for certain, and of a shape, than an effect took away, %^2."""
    return left.structured and left.share * final.held.error_percent**2 > drop


def last_goes(ladder: Sequence[tuple[Rung, list[Trial]]], left: Remainder) -> bool:
    """Whether the last of several effects goes: alone it takes away less than what is left.

    Or it cannot be told from nothing, where something of a shape is left.
    """
    final = ladder[-1][0]
    if len(ladder) < 2 or final.model.effects[:-1] != ladder[-2][0].model.effects:
        return False
    *others, last = _drops(ladder) or [np.inf]
    if others and _outweighs(left, final, last) and not _outweighs(left, final, min(others)):
        return True
    start, own = ladder[0][0].model.effects, final.model.effects
    several = len(own) > len(start) + 1
    return several and left.structured and own[-1] in untold(final.model, start)


def untold(model: Model, start: Sequence[str]) -> list[str]:
    """Return the effects beside those of the `start` of which no amplitude is told from zero."""
    return [key for key in model.effects if key not in start and not is_told(model, key)]


def disagree(note: str, held: float, training: float) -> bool:
    """Whether held-out data keep out what lowers an error by more than a trifle.

    Parameters
    ----------
    note:
        Why an effect does not pass.
    held, training:
        Fall of the squared error over the held-out and over the training data, %^2.
    """
    trifle = TRIFLE_PERCENT**2
    return (note == UNSTEADY and held > trifle) or (
        note.startswith(HELD_BACK) and held > -trifle and training > trifle
    )


def contested(trials: Sequence[Trial], base: Rung, threshold: float) -> Trial | None:
    """Return what training data speak for beyond doubt and held-out data do not, if any.

    That a model is complete cannot be said then, though nothing is named either.  It lowers the
    held-out error by more than what is too small to matter, but not steadily, as waves over a turn
    do whose angle is not measured; or that of the training data, for it stands for what those show
    and the held-out ones hardly do.  What does more harm there than a trifle is just fitted to the
    training data.
    """

    def fall(before: Comparison, after: Comparison) -> float:
        return before.error_percent**2 - after.error_percent**2

    torn = [
        t for t in trials
        if t.delta_bic > SURE * threshold
        and disagree(
            t.note, fall(base.held, t.rung.held), fall(base.training, t.rung.training)
        )
    ]  # fmt: skip
    return max(torn, key=lambda t: t.delta_bic, default=None)


def besides(torn: Trial, final: Rung) -> str:
    """Say that training data speak for more than is named, and held-out data do not."""
    return (
        f'the training data speak for {torn.scored.variant.effect.card.title} besides (their '
        f'error falls from {final.training.error_percent:.3g} to '
        f'{torn.rung.training.error_percent:.3g} %), which the held-out data do not bear out: '
        'more may be missing than is named'
    )


def _told_in_training(base: Rung, final: Rung) -> bool:
    """Whether the training error falls by more than a trifle.

    Held-out data may not know of it: there the motor may do nothing but go on at its speed.
    """
    before, after = base.training.error_percent**2, final.training.error_percent**2
    return before - after > max(TRIFLE_PERCENT**2, OF_TRAINING * before)


def shows_nothing(rung: Rung) -> bool:
    """Whether nothing that is measured is much larger than what a model leaves of it.

    Of a motor that rests, sensors show their noise, and any model explains that.
    """
    errors = rung.held.channel_percent.values()
    return all(not error < MOSTLY_NOISE for error in errors)


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
    the base model leaves beyond the noise is a trifle, and hardly falls, or next to nothing of it
    goes, nothing is then missing, if the training data do not say otherwise.
    Of several effects none may take away less than the missing physics that is left, and none may
    leave nothing of a parameter of the motor that was well known, unless several explain all but a
    trifle and leave nothing of a shape, or the model without knew nothing.  Where base parameters
    are undetermined, what explains nearly all is named all the same; no model is complete where
    sensors show their noise.  Where something of a shape is left, nothing is named that cannot be
    told from nothing, nor by a model that knows nothing.
    """
    base, final = ladder[0][0], ladder[-1][0]
    structured = left.structured
    before, after = base.held.error_percent**2, final.held.error_percent**2
    beyond = before - left.floor_percent**2
    explained = (before - after) / max(beyond, 1e-300)
    vague = min(_vague(base), _vague(final)) >= TOO_VAGUE
    if vague and not structured and (len(ladder) == 1 or explained < EXPLAINED):
        return Verdict.INSUFFICIENT_DATA
    if len(ladder) == 1 and not structured:
        return Verdict.INSUFFICIENT_DATA if shows_nothing(final) else Verdict.COMPLETE
    if len(ladder) == 1:
        return Verdict.UNKNOWN_EFFECT
    missing = min(left.predictable * after, left.beyond_percent**2)
    larger = left.predictable > FAINT and missing > before - after
    doubted = (doubted or larger) and explained < NEARLY_ALL
    surely = (before - after) / max(beyond + FLOOR_SURE * left.floor_percent**2, 1e-300)
    doubted = doubted or max(accounted, surely) < NEARLY_ALL
    trifle = beyond < TRIFLE_PERCENT**2 and before < NOTICED**2 * after
    trifle = trifle or (explained < LITTLE and before < HARDLY**2 * after)
    if doubted and not structured and trifle and not _told_in_training(base, final):
        return Verdict.COMPLETE
    outweighed = _outweighs(left, final, min(_drops(ladder), default=np.inf))
    several = len(final.model.effects) > len(base.model.effects) + 1
    enough = NEARLY_ALL if several else EXPLAINED
    blind = is_wild(final) or bool(untold(final.model, base.model.effects))
    if (structured and (explained < enough or blind)) or outweighed or doubted:
        return Verdict.UNKNOWN_EFFECT
    believed = explained > ALL_BUT_A_TRIFLE and ((several and not structured) or is_wild(base))
    if not believed and gone(final.model, base.model):
        return Verdict.UNKNOWN_EFFECT
    return Verdict.AMBIGUOUS if any(rivals.values()) else Verdict.EFFECT_MISSING
