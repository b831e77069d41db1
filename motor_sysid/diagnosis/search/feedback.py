"""The last fit of data from a closed loop, where the noise of a sensor comes back as input.

A speed that is the difference of encoder counts errs to the other side in the next sample, when
the controller has answered to the first error.  What a plain output error leaves then goes along
with how the motor moves, and draws the fit to itself by several standard errors.  Behind a filter
that makes of the noise what nothing before tells of, it does not.

    e = H^-1 (y - G u),    1 / H an autoregression of what the model leaves

(Ljung, System Identification, 1999, sections 8.4 and 13.4.)
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.rung import BRIEF, judge, lost, Rung, slopes, SPOILED
from motor_sysid.estimation.batch import (
    coloured,
    FitResult,
    Linearization,
    Problem,
    Weighting,
)
from motor_sysid.estimation.batch.least_squares import (
    ENOUGH,
    minimize,
    newton_step,
    normal_equations,
    result_at,
    Solution,
)
from motor_sysid.estimation.batch.methods.reference import moving_references
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

ORDER = 40
"""Order of the noise model: that of what is differenced needs many terms."""

SAMPLES = 20
"""Samples of each stretch for each term, at least."""

STEPS = 10
"""Most steps of a fit where one alone does not lead there."""


def unbiased(rung: Rung, bench: Bench) -> Rung:
    """Return a fit that noise which is fed back does not bias; the same in an open loop.

    One step mostly leads there from the least output error, with the derivatives that are known.
    Where it does not bring half of what it promises, some more are taken: teeth that strike, say,
    are far from linear.  What does the held-out error harm is not taken.  Standard errors stay
    those of the plain fit: what laws have not right counts for more behind such a filter.

    An inductance far below what a sample shows may have fallen to nothing, from where no step
    leads back, and what it does is little, but known behind the filter: such parameters begin
    from their first guess as well, and standard errors are those of the place where that ends.
    """
    if not _applies(bench):
        return rung
    problem, near = bench.problem(rung.model), slopes(rung, bench)
    noise = coloured([problem.settled(one, rung.result.weighting) for one in near], ORDER)
    ways = [_one_step(problem, noise, near) or _some_steps(problem, noise, near)]
    if fallen := lost(rung.model, bench):
        ways.append(_some_steps(bench.problem(rung.model.with_values(fallen)), noise))
    ways = [way for way in ways if way[1]]
    if not ways:
        return rung
    z, near = min(ways, key=lambda way: normal_equations(way[1], noise)[2])
    told = _told(rung.result, problem, z, near, elsewhere=bool(fallen))
    found = judge(told, bench, near)
    return found if found.held.error_percent < SPOILED * rung.held.error_percent else rung


def _one_step(
    problem: Problem, noise: Weighting, near: Sequence[Linearization]
) -> tuple[Array, tuple[Linearization, ...]] | None:
    """Return where one step leads, if it brings what it should."""
    z = problem.vector()
    gradient, curvature, cost = normal_equations(near, noise)
    lower, upper = problem.box()
    inward = ((z > lower) | (gradient > 0.0)) & ((z < upper) | (gradient < 0.0))
    some, move = np.flatnonzero(inward), np.zeros(z.size)
    move[some] = newton_step(gradient[some], curvature[np.ix_(some, some)])
    if not np.all(np.isfinite(move)):
        return None
    z = np.clip(z + _straight(move, problem), lower, upper)
    there = problem.linearize(z, parameters=False)
    near = tuple(replace(a, residual=b.residual) for a, b in zip(near, there, strict=True))
    enough = normal_equations(near, noise)[2] <= cost - ENOUGH * float(move @ gradient)
    return (z, near) if enough else None


def _some_steps(
    problem: Problem, noise: Weighting, near: Sequence[Linearization] = ()
) -> tuple[Array, tuple[Linearization, ...]]:
    """Return where a fit under a noise model leads; nothing near if that is nowhere."""
    found = minimize(problem, noise, iterations=STEPS, tolerance=BRIEF, near=near)
    return found.z, found.near if np.isfinite(found.cost) else ()


def _applies(bench: Bench) -> bool:
    """Whether the data are those of a closed loop, and long enough for the noise model."""
    if bench.horizon is not None or not is_closed(bench):
        return False
    return min(map(len, _train(bench))) >= SAMPLES * ORDER


def _told(
    plain: FitResult,
    problem: Problem,
    z: Array,
    near: tuple[Linearization, ...],
    *,
    elsewhere: bool,
) -> FitResult:
    """Return the result at a vector, with what the plain fit says of its certainty.

    Of a positive parameter that is how far off it may be in proportion.  Where the plain fit was
    `elsewhere`, it says nothing of it.
    """
    cost = normal_equations(near, plain.weighting)[2]
    solution = Solution(z, cost, plain.success, plain.iterations + 1, plain.simulations + 1, near)
    result = result_at(
        problem, plain.weighting, solution, solution.simulations, solution.iterations
    )
    if elsewhere:
        return result
    free = plain.model.parameters.free
    grown = [result.model[p.name] / p.value if p.logarithmic else 1.0 for p in free]
    known = zip(free, grown, strict=True)
    sigmas = {p.name: p.sigma * one for p, one in known if p.sigma is not None}
    model = result.model.with_estimates({}, sigmas)
    return replace(result, model=model, covariance=plain.covariance * np.outer(grown, grown))


def is_closed(bench: Bench) -> bool:
    """Whether a controller drove the motor in some of the training data."""
    return any(moving_references(record) for record in _train(bench))


def _straight(move: Array, problem: Problem) -> Array:
    """Return the move that is as far in the parameters as the given one promises to be.

    The logarithm of an inductance far below what a sample shows would run away.
    """
    rises = np.array([p.logarithmic for p in problem.free]) & (move > 0.0)
    return np.where(rises, np.log1p(np.abs(move)), move)


def _train(bench: Bench) -> list[Record]:
    """Return the training stretches."""
    return [r for r, role in zip(bench.records, bench.roles, strict=True) if role == 'train']
