"""Find the experiment that separates rival models, and prove it before it is proposed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from motor_sysid.diagnosis.experiment.information import known
from motor_sysid.diagnosis.experiment.library import Choice, choices, Tried, tried, variations
from motor_sysid.diagnosis.experiment.separate import (
    against,
    contains,
    Contrast,
    contrasts,
    weakest,
)
from motor_sysid.diagnosis.experiment.stage import Stage
from motor_sysid.diagnosis.result.threshold import UNCALIBRATED
from motor_sysid.physics.model import Model

SURE = 2 * UNCALIBRATED
"""Expected dBIC from which an experiment is said to decide: what is found then scatters by about
twice its root, and seldom falls below what the diagnosis asks for."""

PLENTY = 10 * UNCALIBRATED
"""Expected dBIC above which more is not better, but a shorter experiment is."""

FINALISTS, HASTY = 4, 2
"""Experiments that are looked at closely before it is said that none separates the rivals; and
in a hurry."""

SHARPER = 8.0
"""How much sharper the signs of speed and current are made in the proof: what only their smoothed
width shows is no difference that a motor has."""

OPEN = 0.5
"""Standard deviation over that of the prior from which a direction counts as left open."""

FAR = 1.5
"""Standard deviations that the truth is moved along what the data leave open."""

Pair = tuple[int, int]


@dataclass(frozen=True)
class Found:
    """An experiment and what it is expected to bring.

    Attributes
    ----------
    tried:
        The experiment.
    contrasts:
        Every model against every other.
    pairs:
        Places of two models to the smaller expected dBIC of the two.
    worst:
        The same for the least favourable truth that the data leave open; empty if not looked at.
    """

    tried: Tried
    contrasts: tuple[Contrast, ...]
    pairs: Mapping[Pair, float]
    worst: Mapping[Pair, float]

    @property
    def decides(self) -> bool:
        """Whether every pair is expected to be told apart."""
        return all(value >= SURE for value in self.pairs.values())

    def rank(self) -> tuple[float, float]:
        """Return what the best experiment has most of: evidence up to plenty, then brevity."""
        useful = sum(min(value, PLENTY) for value in self.pairs.values())
        return useful, -self.tried.profile.duration


def discriminate(
    stage: Stage,
    fine: Stage | None = None,
    *,
    quick: bool = False,
    tell: Callable[[str], None] = lambda text: None,
) -> Found | None:
    """Return the best experiment that was proved, or the best at all if none separates.

    Parameters
    ----------
    stage:
        With the rivals; the experiments are compared on it.
    fine:
        Where the best are proved, finely sampled; without, on the same.
    quick:
        Try a handful of experiments only.
    tell:
        Is told what is going on.

    Returns
    -------
    None where no experiment fits the limits.
    """
    everything = list(choices(stage, quick=quick))
    tell(f'trying {len(everything)} experiments')
    found = _ranked(stage, everything)
    if found and not quick:
        shorter = [v for best in found[:2] for v in variations(best.tried.choice)]
        tell(f'trying {len(shorter)} shorter or denser forms of the best')
        found = sorted([*found, *_ranked(stage, shorter)], key=Found.rank, reverse=True)
    best: Found | None = None
    for one in found[: HASTY if fine is None else FINALISTS]:
        tell(f'proving {one.tried.profile.name}')
        closer = proof(stage, one) if fine is None else proof_in_full(fine, one)
        if closer is not None and closer.decides:
            return closer
        if closer is not None and (best is None or closer.rank() > best.rank()):
            best = closer
    return best


def _ranked(stage: Stage, experiments: Sequence[Choice]) -> list[Found]:
    found = []
    for choice in experiments:
        one = tried(stage, choice)
        if one is not None:
            seen = tuple(contrasts(stage, one.runs))
            found.append(Found(one, seen, weakest(seen), {}))
    return sorted(found, key=Found.rank, reverse=True)


def proof(stage: Stage, found: Found) -> Found:
    """Refit for real, with the signs of friction as sharp as those of a real motor."""
    sharp = stage.with_models([sharper(model) for model in stage.models])
    runs = [sharp.run(found.tried.profile, k) for k in range(len(sharp.models))]
    seen = tuple(contrasts(sharp, runs, real=True))
    other = weakest(seen)
    least = {pair: min(value, other[pair]) for pair, value in found.pairs.items()}
    return Found(found.tried, seen, least, {})


def proof_in_full(fine: Stage, found: Found) -> Found | None:
    """Look at an experiment closely: finely sampled, with real refits, and unfavourable truths.

    Returns
    -------
    None where it breaks a limit when looked at closely.
    """
    one = tried(fine, found.tried.choice)
    if one is None:
        return None
    seen = tuple(contrasts(fine, one.runs, real=True))
    closer = proof(fine, Found(one, seen, weakest(seen), {}))
    return replace(closer, worst=unfavourable(fine, closer)) if closer.decides else closer


def sharper(model: Model) -> Model:
    """Return the model with narrower signs of speed and current."""
    names = [p.name for p in model.kind.parameters if p.name.endswith('_eps')]
    boxes = {name: model.parameters[name] for name in names}
    return model.with_values(
        {name: max(p.value / SHARPER, p.lower) for name, p in boxes.items()}
    )


def unfavourable(stage: Stage, found: Found) -> dict[Pair, float]:
    """Return the dBIC of each pair for the least favourable truth that the data leave open."""
    worst = dict(found.pairs)
    for place, model in enumerate(stage.models):
        for other in displaced(stage, model):
            run = stage.run(found.tried.profile, place, other)
            for rival in range(len(stage.models)):
                if rival == place or contains(stage.models[rival], model):
                    continue
                count = len(model.parameters.free)
                seen = against(
                    stage, run, (place, rival), count, stage.models[rival], real=True
                )
                pair = (min(place, rival), max(place, rival))
                worst[pair] = min(worst[pair], seen.delta_bic)
    return worst


def displaced(stage: Stage, model: Model) -> list[Model]:
    """Return the model moved both ways along what the data leave open, inside its box."""
    knowledge = known(stage, model)
    direction, sigma = knowledge.loosest()
    if sigma < OPEN:
        return []
    problem = knowledge.problem
    z = problem.vector()
    lower, upper = problem.box()
    moved = []
    for way in (1.0, -1.0):
        step = way * FAR * sigma * direction
        with np.errstate(divide='ignore', invalid='ignore'):
            room = np.where(step > 0, (upper - z) / step, (lower - z) / step)
        share = min(1.0, float(np.min(room[step != 0], initial=1.0)))
        if share > 0.01:
            moved.append(problem.model_at(z + share * step))
    return moved
