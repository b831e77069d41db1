"""Where a fit begins of an effect of whose strength a touch tells little: the best of a grid.

A load behind a shaft swings with the motor at a frequency that rises with its inertia: a touch of
it swings elsewhere.  So finite trials of all combinations are simulated together, and judged by
what the motor's own parameters cannot make up for.
"""

from collections.abc import Sequence
from itertools import groupby, product

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.candidates.columns import run_lanes
from motor_sysid.diagnosis.candidates.score import Base
from motor_sysid.diagnosis.candidates.variants import shrunk, Variant
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.rung import some_of
from motor_sysid.estimation.batch import Problem, thinned, white
from motor_sysid.physics.model import Model
from motor_sysid.physics.rollout import Program
from motor_sysid.physics.scales import Scales

Array = NDArray[np.float64]
Values = dict[str, float]

ROWS = 4000
"""Rows that points of a grid are judged by."""

BEST = 2
"""Points of a grid from which fits begin, at most."""

RUNAWAY = 1e50
"""Outputs that no motor has, in any unit."""


def starts_on_grid(variant: Variant, base: Model, bench: Bench) -> list[Values]:
    """Return values of an effect, and of what it shrinks, with which it does better than without.

    Parameters
    ----------
    variant:
        The effect, added to `base`.
    base:
        The fitted model without it.

    Returns
    -------
    At most `BEST`, best first; none for an effect whose card has no grid.
    """
    points = _points(variant, base, bench.scales)
    if not points:
        return []
    some = thinned(some_of(bench, variant.model), bench.kind, bench.outputs, ROWS)
    problem = Problem(base, some, bench.outputs)
    near = problem.linearize(problem.vector())
    weighting = white([problem.settled(one, white([one.residual])) for one in near])
    runs = _runs(Program.of(variant.model, bench.outputs), problem, variant, points)
    sound = [k for k in range(len(points)) if all(_stays(run[:, :, k]) for run in runs)]
    if not sound or not all(_stays(one.slope) for one in near):
        return []
    points, runs = [points[k] for k in sound], [run[:, :, sound] for run in runs]
    columns = [
        np.concatenate(
            (one.residual[:, :, np.newaxis], one.slope, s.judged[:, :, np.newaxis] - outputs), 2
        )
        for one, s, outputs in zip(near, problem.stretches, runs, strict=True)
    ]
    own = 1 + problem.dimension
    gram = weighting.gram(columns, [one.start for one in near])
    left = np.diag(Base.of(gram, np.arange(1, own)).without(gram))
    better = [k for k in np.argsort(left[own:]) if left[own + k] < left[0]]
    return [points[k] for k in better[:BEST]]


def begun_at(point: Values, model: Model, variant: Variant) -> Model:
    """Return a model with the values of a point, free where they bend the law."""
    key, card = variant.effect.key, variant.effect.card
    bends = [f'{key}.{shape.name}' for shape in card.shapes if shape.bends]
    bent = [name for name in bends if point.get(name, model[name]) != model[name]]
    return model.with_values(point).with_free(bent)


def _stays(values: Array) -> bool:
    """Whether values stay within bounds: a point may be no motor, or run away."""
    return bool(np.all(np.abs(values) < RUNAWAY))


def _points(variant: Variant, base: Model, scales: Scales) -> list[Values]:
    """Return every combination of a grid, and what it shrinks in its share, inside the boxes."""
    card, key, model = variant.effect.card, variant.effect.key, variant.model
    scale = {p.name: scales.size(p.scale) for p in card.parameters}
    scale |= dict.fromkeys(card.slows.values(), 1.0)
    first, points = f'{key}.{card.amplitudes[0].name}', list[Values]()
    for grid in card.grids:
        for one in product(*grid.values()):
            chosen = zip(grid, one, strict=True)
            point = {f'{key}.{name}': value * scale[name] for name, value in chosen}
            point |= _slowed(variant, base, point, point[first])
            point |= shrunk(card, base, point[first], model[first])
            points.append(model.parameters.inside(point))
    return [point for k, point in enumerate(points) if point not in points[:k]]


def _slowed(variant: Variant, base: Model, point: Values, load: float) -> Values:
    """Return how fast friction of its own slows a load, and what that leaves of the motor's.

    `point` holds the share of the friction that the load has; with `load` times the motor's own
    inertia, it and the motor are together as slow as `base`.
    """
    card, key = variant.effect.card, variant.effect.key
    whole = next((base[name] for name in card.shrinks if name in base.parameters), 0.0)
    found = {f'{key}.{shape}': 0.0 for shape in card.slows.values()}
    for name, shape in card.slows.items():
        if name in base.parameters and whole > 0:
            share, own = point.get(f'{key}.{shape}', 0.0), base[name]
            found[name] = (1.0 - share) * own
            found[f'{key}.{shape}'] = share * own / whole * (1.0 + load) / load
    return found


def _runs(
    program: Program, problem: Problem, variant: Variant, points: Sequence[Values]
) -> list[Array]:
    """Return for each scored stretch the outputs (N, n_y, P) at all points.

    Points of one pace are simulated together, as the fastest sets the steps of all.
    """
    pace = f'{variant.effect.key}.{variant.effect.card.pace}'
    order = sorted(range(len(points)), key=lambda k: points[k].get(pace, 0.0))
    found = []
    for _, group in groupby(order, key=lambda k: points[k].get(pace, 0.0)):
        lanes = [{**variant.model.parameters.values(), **points[k]} for k in group]
        table = {name: np.array([lane[name] for lane in lanes]) for name in program.names}
        found.append(run_lanes(program, variant.model, problem, table))
    back = np.argsort(order)
    return [np.concatenate(parts, axis=2)[:, :, back] for parts in zip(*found, strict=True)]
