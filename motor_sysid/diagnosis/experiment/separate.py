"""How well an experiment separates two models (T-optimality).

One of the models is taken for the truth and simulated; the other is refitted to that run, within
its box, and what remains of the difference, whitened with the noise of the recorded data, is the
evidence that the experiment would bring: ``dBIC = |W (y_a - y_b(refitted))|^2`` plus the price of
the parameters.  The refit is a linearised one (a projection on the complement of the rival's
sensitivities, inside the box) while many experiments are compared, and a real one for those that
are proposed.  (Atkinson and Fedorov 1975, doi:10.1093/biomet/62.1.57.)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from motor_sysid.diagnosis.experiment.stage import Run, Stage
from motor_sysid.estimation.batch import Problem
from motor_sysid.estimation.batch.least_squares import minimize
from motor_sysid.estimation.batch.problem import weighed
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

REACH = 2.0
"""Largest relative change of a positive parameter that a linearised refit may propose."""

SINGULAR = 1e-12
"""Eigenvalue of the scaled sensitivities, over the largest one, that counts as that size."""

ITERATIONS, TOLERANCE = 8, 0.01
"""Steps of a real refit, and the relative decrease that is worth a further one."""


@dataclass(frozen=True)
class Contrast:
    """What a run of one model would say against another.

    Attributes
    ----------
    truth, rival:
        Places of the two models on the stage.
    distance:
        Whitened squared difference that the refitted rival leaves.
    delta_bic:
        Expected gain in BIC of the truth over the rival.
    change:
        (d,) how far the rival's coordinates moved in the refit.
    """

    truth: int
    rival: int
    distance: float
    delta_bic: float
    change: Array


def contrast(stage: Stage, run: Run, truth: int, rival: int, *, real: bool = False) -> Contrast:
    """Say what the run of one model would say against another.

    Parameters
    ----------
    stage, run:
        The stage, and the run of the model `truth` on it.
    truth, rival:
        Places of the models.
    real:
        Whether to refit for real after the linearised refit.
    """
    a, b = stage.models[truth], stage.models[rival]
    return against(stage, run, (truth, rival), len(a.parameters.free), b, real)


def against(
    stage: Stage, run: Run, places: tuple[int, int], count: int, rival: Model, real: bool
) -> Contrast:
    """Compare a run of a model with `count` free parameters with a rival."""
    problem = stage.problem(rival, [run.record])
    z = problem.vector()
    change, distance = projected(stage, problem, z)
    if real:
        near = problem.linearize(z, parameters=False)
        lower, upper = problem.box()
        starts = np.stack([z, np.clip(z + change, lower, upper)])
        start = starts[int(np.argmin(problem.costs(starts, stage.weighting, near)))]
        best = minimize(
            problem, stage.weighting, start=start, iterations=ITERATIONS, tolerance=TOLERANCE
        )
        change, distance = best.z - z, best.cost
    rows = sum(s.judged.size for s in problem.stretches)
    price = (problem.dimension - count) * np.log(rows)
    return Contrast(*places, distance, distance + float(price), change)


def projected(stage: Stage, problem: Problem, z: Array) -> tuple[Array, float]:
    """Return the change of z that a linearised refit proposes, and the distance that it leaves.

    Logarithms are taken for relative changes, so that a parameter can vanish; bounds hold.
    """
    gram = np.zeros((z.size + 1, z.size + 1))
    for rest in weighed(problem.linearize(z), stage.weighting):
        gram += rest.T @ rest
    if not np.all(np.isfinite(gram)):
        return np.zeros(z.size), np.inf
    whole = float(gram[-1, -1])
    size = np.sqrt(np.diag(gram)[:-1])
    seen = size > 1e-12 * np.max(size, initial=1e-300)
    if not np.any(seen):
        return np.zeros(z.size), whole
    size, low, high = size[seen], *(bound[seen] for bound in reachable(problem, z))
    values, vectors = np.linalg.eigh(gram[:-1, :-1][np.ix_(seen, seen)] / np.outer(size, size))
    root = np.sqrt(np.maximum(values, SINGULAR * values[-1]))
    target = vectors.T @ (gram[:-1, -1][seen] / size) / root
    found = lsq_linear(root[:, np.newaxis] * vectors.T, target, (low * size, high * size))
    change = np.zeros(z.size)
    change[seen] = found.x / size
    return change, max(whole - float(target @ target), 0.0) + 2 * float(found.cost)


def reachable(problem: Problem, z: Array) -> tuple[Array, Array]:
    """Return the largest changes of z down and up that a linearised refit may propose."""
    lower, upper = problem.box()
    relative = np.array([p.logarithmic for p in problem.free])
    low = np.where(relative, np.expm1(np.maximum(lower - z, -50.0)), lower - z)
    high = np.where(relative, np.minimum(np.expm1(np.minimum(upper - z, 5.0)), REACH), upper - z)
    tiny = 1e-9
    return np.minimum(low, -tiny), np.maximum(high, tiny)


def contrasts(stage: Stage, runs: Sequence[Run], *, real: bool = False) -> list[Contrast]:
    """Compare every model's run with every other model that does not contain it.

    A model refits every run of its own special case without a rest; what is asked is whether the
    special case would be found wanting.
    """
    places = range(len(stage.models))
    return [
        contrast(stage, runs[a], a, b, real=real)
        for a in places
        for b in places
        if a != b and not contains(stage.models[b], stage.models[a])
    ]


def contains(larger: Model, smaller: Model) -> bool:
    """Whether every effect of the one is an effect of the other, or a special case of one."""
    covered = set(larger.effects)
    for key in larger.effects:
        covered |= set(effect(key).card.generalises)
    more = len(larger.parameters.free) > len(smaller.parameters.free)
    return more and set(smaller.effects) <= covered


def weakest(found: Sequence[Contrast]) -> dict[tuple[int, int], float]:
    """Return for each pair of models the smaller dBIC: whichever of them is true."""
    pairs: dict[tuple[int, int], float] = {}
    for one in found:
        pair = (min(one.truth, one.rival), max(one.truth, one.rival))
        pairs[pair] = min(pairs.get(pair, np.inf), one.delta_bic)
    return pairs
