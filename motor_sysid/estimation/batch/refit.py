"""Refit a model on a stretch of data: an optimizer for the basin, least squares for the digits.

A population alone, at the budget of the papers (30 members, 50 iterations), ends tens of percent
from the optimum; least squares from its best member does not.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.chains import make_chain, observed_outputs
from motor_sysid.estimation.batch.least_squares import fit, result_at, Solution
from motor_sysid.estimation.batch.methods import DIRECT, STARTED
from motor_sysid.estimation.batch.optimizers import Found, OPTIMIZERS, search
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.estimation.batch.weighting import Weighting, white
from motor_sysid.physics.effect import Amplitude
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.scales import Scales, scales_of
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

METHODS = (*OPTIMIZERS, *STARTED, *DIRECT)
"""What `refit` can do."""

_FACTOR, _NEAR = 8.0, 2.0
_AMPLITUDE = 2.0
_OFFSET = 0.5
_GAP = 10.5
_SHORTEST = 50


def refit(
    model: Model,
    records: Record | Sequence[Record],
    method: str = 'pso',
    *,
    population: int = 30,
    iterations: int = 50,
    seed: int = 0,
    polish: bool = True,
    threads: int = 1,
) -> FitResult:
    """Fit a model's free parameters to records, from anywhere in a box around its values.

    The box of a positive parameter reaches from an eighth to eight times its value, that of an
    amplitude to twice its scale in the data; neither leaves the parameter's own box.  A hybrid
    with a start of its own searches from half to twice what that says.

    Parameters
    ----------
    model:
        Where the box lies.
    records:
        Data; they are cut where samples are missing.
    method:
        Key of `OPTIMIZERS` (docs/optimizers.md), `STARTED` or `DIRECT` (docs/estimation.md).
    population, iterations, seed:
        Of the optimizer; the product of the first two is the largest number of its simulations.
    polish:
        Whether least squares follow; without, the result is what the optimizer found, and the
        walls of its box that it met are among the warnings.
    threads:
        Blocks of 32 simulations that may run at the same time.

    Raises
    ------
    UserError
        If the method is unknown or the records hold too little.
    """
    if method not in METHODS:
        raise UserError(f'unknown method `{method}`; known are {", ".join(METHODS)}')
    pieces = _pieces([records] if isinstance(records, Record) else records)
    outputs = observed_outputs(model.kind, pieces)
    chains = [make_chain(piece, model.kind, outputs) for piece in pieces]
    problem = Problem(model, chains, outputs, threads=threads)
    if not problem.free:
        raise UserError('the model has no free parameter; free one with `Model.with_free`')
    if method in DIRECT:
        return DIRECT[method](problem)
    factor = _FACTOR
    if method in STARTED:
        method, begun = STARTED[method]
        problem, factor = begun(problem), _NEAR
    weighting = white([s.judged - s.judged.mean(axis=0) for s in problem.stretches])
    rng = np.random.default_rng(seed)
    found = _searched(problem, weighting, pieces, method, factor, population, iterations, rng)
    effort = found.evaluations
    if polish:
        result = fit(problem, start=found.x)
        return replace(result, simulations=result.simulations + effort)
    solution = Solution(found.x, found.cost, True, len(found.history), effort)
    result = result_at(problem, weighting, solution, effort, 0)
    return replace(
        result, reason=found.reason, warnings=(*result.warnings, *_walls(problem, found))
    )


def _pieces(records: Sequence[Record]) -> list[Record]:
    """Cut records where samples are missing; what is very short goes."""
    pieces = [piece for record in records for piece in record.segments(_GAP * record.dt)]
    pieces = [piece for piece in pieces if len(piece) >= _SHORTEST]
    if not pieces:
        raise UserError(
            f'no stretch of {_SHORTEST} samples without a gap; a refit needs more data'
        )
    return pieces


def _searched(
    problem: Problem,
    weighting: Weighting,
    records: Sequence[Record],
    method: str,
    factor: float,
    population: int,
    iterations: int,
    rng: np.random.Generator,
) -> Found:
    """Return what an optimizer finds in the box around the problem's own vector."""
    start = problem.vector()
    lower, upper = _box(
        problem, scales_of(problem.model.motor, problem.model.parameters.values(), records),
        factor,
    )
    near = problem.linearize(start, parameters=False)
    return search(
        lambda z: problem.costs(z, weighting, near),
        lower,
        upper,
        method=method,
        population=population,
        iterations=iterations,
        rng=rng,
        start=start,
    )


def _walls(problem: Problem, found: Found) -> list[str]:
    """Say which parameters ended on a wall of the box of the search."""
    now = problem.values(found.x[np.newaxis, :])
    held = [problem.free[k] for k in found.on_bound]
    return [
        f'{p.name} = {now[p.name][0]:.4g} {p.unit} sits on a wall of the box that was searched; '
        'start from a value that is nearer, or let least squares follow (`polish`)'
        for p in held
        if not problem.model_at(found.x).parameters[p.name].on_bound
    ]


def _box(problem: Problem, scales: Scales, factor: float) -> tuple[Array, Array]:
    """Return the box of the search around the problem's own vector."""
    model, z = problem.model, problem.vector()
    reach = _reaches(model, scales)
    way = np.array(
        [
            np.log(factor) if p.logarithmic else reach.get(p.name, abs(p.value)) / size
            for p, size in zip(problem.free, problem.size, strict=True)
        ]
    )
    lower, upper = problem.box()
    return np.maximum(lower, z - way), np.minimum(upper, z + way)


def _reaches(model: Model, scales: Scales) -> dict[str, float]:
    """Return how far amplitudes and offsets may lie from their values."""
    reach = {}
    for key in model.effects:
        for card in effect(key).card.parameters:
            if isinstance(card, Amplitude):
                most = min(max(card.trials, default=_AMPLITUDE), card.limit)
                reach[f'{key}.{card.name}'] = most * scales.size(card.scale)
    for output in model.kind.outputs:
        if output.bias:
            size = {'current': scales.current, 'speed': scales.speed}.get(output.signal, 1.0)
            reach[output.bias] = _OFFSET * size
    return reach
