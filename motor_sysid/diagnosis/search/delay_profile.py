"""The standard error of a delay: from how the error rises when the delay is held elsewhere.

Wherever an edge of the input passes a sample, the outputs bend; and what a delay of part of a
sample does a slower current does as well.  So the error is no parabola in a delay: it may lie in a
sharp notch from which a long flat valley leads to the truth.  (Venzon and Moolgavkar 1988,
doi:10.2307/2347496.)
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.estimation.batch import Problem, Weighting
from motor_sysid.estimation.batch.information import Information
from motor_sysid.estimation.batch.least_squares import minimize
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

CHANCE, NORMAL = 3.84, 1.96
"""Rise of the weighted sum of squares at the ends of a 95 % interval, and where these lie."""

LEAST, MOST = 0.01, 1.0
"""First step and last in samples: at a whole sample the notch may be as narrow as rounding."""

STEPS, TOLERANCE = 4, 1e-6
"""Most iterations and least relative decrease of a fit with the delay held."""


def with_profiled_delays(
    model: Model, bench: Bench, weighting: Weighting, bound: Information
) -> Model:
    """Return a fitted model whose delays have the standard error that their profile tells.

    It is no less than what the derivatives told.  Noise that is correlated makes chance larger, as
    much as the standard error there is larger than the `bound` for white noise.
    """
    found, best = {}, dict(zip(bound.names, bound.bound, strict=True))
    for name in delays_of(model):
        p = model.parameters[name]
        if p.sigma is None or not np.isfinite(p.sigma):
            continue
        chance = CHANCE * max(p.sigma / best[name], 1.0) ** 2 if best[name] > 0.0 else CHANCE
        dt = bench.train[0][0].drive.dt
        least = held_at(model, name, p.value, bench, weighting)[1]
        begun = max(NORMAL * p.sigma, LEAST * dt)
        reached = [begun, *_doubled(begun, max(MOST * dt, begun))]
        sides = [
            _width(model, name, np.array(reached) * way, bench, weighting, least + chance, least)
            for way in (-1.0, 1.0)
        ]
        found[name] = max(p.sigma, *(side / NORMAL for side in sides))
    return model.with_estimates({}, found)


def delays_of(model: Model) -> list[str]:
    """Return the free parameters that delay the input."""
    names = [f'{key}.{effect(key).card.delay}' for key in model.effects if effect(key).card.delay]
    return [name for name in names if model.parameters[name].free]


def _doubled(begun: float, last: float) -> Iterator[float]:
    while begun < last:
        begun *= 2.0
        yield begun


def _width(
    model: Model,
    name: str,
    moves: Array,
    bench: Bench,
    weighting: Weighting,
    allowed: float,
    least: float,
) -> float:
    """Return how far a delay may go until the sum of squares is more than `allowed`."""
    p, inside = model.parameters[name], 0.0
    for move in moves:
        value = float(np.clip(p.value + move, p.lower, p.upper))
        model, cost = held_at(model, name, value, bench, weighting)
        far = abs(value - p.value)
        if cost > allowed:
            return max(inside, far * float(np.sqrt((allowed - least) / (cost - least))))
        inside = far
        if value in (p.lower, p.upper):
            break
    return inside


def held_at(
    model: Model, name: str, value: float, bench: Bench, weighting: Weighting
) -> tuple[Model, float]:
    """Return the best model with a parameter held at a value, and its weighted sum of squares."""
    held = model.with_values({name: value}).with_free([name], free=False)
    problem = Problem(
        held, bench.train, bench.outputs, substeps=bench.substeps, one_sided=True
    )
    found = minimize(problem, weighting, iterations=STEPS, tolerance=TOLERANCE)
    return problem.model_at(found.z), found.cost
