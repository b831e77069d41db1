"""A ladder told one effect at a time, where the climb took two at once or ways it left again."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

from motor_sysid.diagnosis.candidates.score import Scored
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.rung import climb, profile_cost, Rung
from motor_sysid.diagnosis.search.trial import judged, Ladder, Level
from motor_sysid.estimation.batch import Weighting
from motor_sysid.physics.effects import effect


def retold(ladder: Ladder, bench: Bench, weighting: Weighting, scored: Iterable[Scored]) -> Ladder:
    """Return a ladder to the same model on which each rung has one effect more than the last.

    One that is like that already stays as it is.  Otherwise effects are taken off the last model,
    each time the one that is missed least, and the evidence of each is taken anew.

    Parameters
    ----------
    weighting:
        The noise model under which evidence counts.
    scored:
        Scores of effects on any model; an effect without one leaves the ladder as it is.
    """
    if all(_is_one_step(before, after) for before, after in pairwise(_models(ladder))):
        return ladder
    (base, first), (final, last) = ladder[0], ladder[-1]
    starts = {one.variant.effect.key: one for one in reversed(list(scored))}
    if not set(_added(base, final)) <= starts.keys():
        return ladder
    rungs = [final]
    while len(own := _added(base, rungs[-1])) > 1:
        model, known = rungs[-1].model, rungs[-1].result.weighting
        fewer = [climb(model.without_effect(key), bench, known, briefly=True) for key in own]
        rungs.append(min(fewer, key=lambda rung: profile_cost(rung, bench, weighting)[0]))
    told: Ladder = []
    for before, after in pairwise([base, *reversed(rungs)]):
        key = _added(before, after)[0]
        trial = judged(starts[key], after, Level.of(before, bench, weighting), bench)
        others = [t for t in first if t.key != key] if before is base else []
        told.append((before, [replace(trial, note=''), *others]))
    return [*told, (final, last)]


def _models(ladder: Ladder) -> Sequence[tuple[str, ...]]:
    return [rung.model.effects for rung, _ in ladder]


def _added(base: Rung, rung: Rung) -> list[str]:
    return [key for key in rung.model.effects if key not in base.model.effects]


def _is_one_step(before: Sequence[str], after: Sequence[str]) -> bool:
    """Whether a model has one effect more than another; it may have taken in narrower ones."""
    more = [key for key in after if key not in before]
    gone = set(before) - set(after)
    return len(more) == 1 and gone <= set(effect(more[0]).card.generalises)
