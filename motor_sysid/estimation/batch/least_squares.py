"""Output-error least squares: Levenberg-Marquardt whose every step is one block of simulations.

The Jacobian is made of central differences, 15 parameters to a block of 32 simulations, and a
second block tries 24 combinations of damping and step length at once.
(Marquardt 1963, doi:10.1137/0111030; Ljung 1999, sections 7.2 and 10.2.)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.problem import Linearization, Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.estimation.batch.uncertainty import describe
from motor_sysid.estimation.batch.weighting import Weighting, white
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

_DAMPINGS = (0.0, 1e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0, 1e3, 1e4)
_LENGTHS = (1.0, 0.4)
_SEEN = 1e-12
"""Relative eigenvalue of the scaled curvature below which a direction is not there."""

ENOUGH = 0.5
"""Share of the promised decrease that an undamped step must bring to be taken as it is."""


@dataclass(frozen=True)
class Solution:
    """Where a minimization ended.

    Attributes
    ----------
    z, cost:
        Vector and sum of squares.
    converged:
        Whether it stopped because nothing was left to gain.
    iterations, simulations:
        Effort.
    near:
        Residuals and derivatives at `z`, one for each scored stretch; empty if not known.
    """

    z: Array
    cost: float
    converged: bool
    iterations: int
    simulations: int
    near: tuple[Linearization, ...] = ()


def fit(
    problem: Problem,
    weighting: Weighting | None = None,
    *,
    start: Array | None = None,
    reweight: int = 3,
    floor: Array | float = 1e-12,
    iterations: int = 30,
    tolerance: float = 1e-7,
) -> FitResult:
    """Fit a model to data.

    Parameters
    ----------
    problem:
        Model and data.
    weighting:
        Noise model to begin with; by default white, as large as the measured signals.
    start:
        (d,) start vector; by default the model's own values.
    reweight:
        How often the noise is set to the RMS error of each output and the fit repeated: the
        maximum-likelihood estimate for white noise of unknown size.  With 0 the given weighting
        stays.
    floor:
        (n_y,) smallest standard deviation that an output's error may be given.
    iterations, tolerance:
        Most steps of one minimization; smallest relative decrease that is worth a further step.
    """
    return fit_and_slopes(
        problem, weighting, start=start, reweight=reweight, floor=floor, iterations=iterations,
        tolerance=tolerance,
    )[0]  # fmt: skip


@np.errstate(over='ignore', invalid='ignore')  # parameters on the way may be no motor
def fit_and_slopes(
    problem: Problem,
    weighting: Weighting | None = None,
    *,
    start: Array | None = None,
    reweight: int = 3,
    floor: Array | float = 1e-12,
    iterations: int = 30,
    tolerance: float = 1e-7,
    near: Sequence[Linearization] = (),
) -> tuple[FitResult, tuple[Linearization, ...]]:
    """Fit as `fit` does; return residuals and derivatives at the solution, too.

    `near` holds those at the start, if they are known.
    """
    if weighting is None:
        weighting = white([s.judged - s.judged.mean(axis=0) for s in problem.stretches])
    solution = minimize(
        problem, weighting, start=start, iterations=iterations, tolerance=tolerance, near=near
    )
    simulations, steps = solution.simulations, solution.iterations
    for _ in range(reweight):
        fresh = white([problem.settled(one, weighting) for one in solution.near], floor)
        if np.all(np.abs(np.log(fresh.sigma / weighting.sigma)) < 0.02):
            break
        weighting = fresh
        solution = minimize(
            problem, weighting, start=solution.z, iterations=iterations, tolerance=tolerance,
            near=solution.near,
        )  # fmt: skip
        simulations += solution.simulations
        steps += solution.iterations
    return result_at(problem, weighting, solution, simulations, steps), solution.near


def minimize(
    problem: Problem,
    weighting: Weighting,
    *,
    start: Array | None = None,
    iterations: int = 30,
    tolerance: float = 1e-7,
    near: Sequence[Linearization] = (),
) -> Solution:
    """Minimize the weighted sum of squares by damped Gauss-Newton steps inside the box.

    Where the undamped step brings most of what the linearization promises it is taken: its
    simulations give the next derivatives as well.  Elsewhere the best of many dampings and lengths
    is, until that is the undamped step again.  It ends where the promise falls under `tolerance`
    times the cost.

    Parameters
    ----------
    near:
        Residuals and derivatives at `start`, if they are known.
    """
    lower, upper = problem.box()
    z = np.clip(problem.vector() if start is None else start, lower, upper)
    sides = 1 if problem.one_sided else 2
    simulations, each, trusted = 0, sides * z.size + 1, True
    if not near:
        near = problem.linearize(z)
        simulations += each
    gradient, curvature, cost = posed(problem, z, near, weighting)
    for iteration in range(1, iterations + 1):
        trials, most = _trials(z, gradient, curvature, lower, upper, problem.reach())
        if not most >= tolerance * cost:
            return Solution(z, cost, bool(np.isfinite(cost)), iteration, simulations, tuple(near))
        best, enough = 0, False
        if trusted:
            ahead = problem.linearize(trials[0])
            equations = posed(problem, trials[best], ahead, weighting)
            simulations += each
            promise = _promise(trials[0] - z, gradient, curvature)
            enough = promise > 0 and equations[2] < cost - ENOUGH * promise
        if not enough:
            costs = problem.costs(trials, weighting, near)
            best = int(np.argmin(costs))
            simulations += len(trials)
            if not costs[best] < cost:
                return Solution(
                    z, cost, bool(np.isfinite(cost)), iteration, simulations, tuple(near)
                )
        if best > 0 or not trusted:
            ahead = problem.linearize(trials[best])
            equations = posed(problem, trials[best], ahead, weighting)
            simulations += each
        trusted = best == 0
        gain = (cost - equations[2]) / cost if np.isfinite(cost) else 1.0
        z, near, (gradient, curvature, cost) = trials[best], ahead, equations
        if gain < tolerance:
            return Solution(z, cost, True, iteration, simulations, tuple(near))
    return Solution(z, cost, False, iterations, simulations, tuple(near))


def _promise(step: Array, gradient: Array, curvature: Array) -> float:
    """Return the decrease of the sum of squares that the linearization promises for a step."""
    return float(2 * step @ gradient - step @ curvature @ step)


def posed(
    problem: Problem, z: Array, near: Sequence[Linearization], weighting: Weighting
) -> tuple[Array, Array, float]:
    """Return the normal equations of data and prior together."""
    gradient, curvature, cost = normal_equations(near, weighting)
    if problem.prior is None:
        return gradient, curvature, cost
    gradient = gradient + problem.precision @ (problem.believed - z)
    surprise = float(problem.surprise(z[np.newaxis])[0])
    return gradient, curvature + problem.precision, cost + surprise


def normal_equations(
    near: Sequence[Linearization], weighting: Weighting
) -> tuple[Array, Array, float]:
    """Return gradient (d,), curvature (d, d) and sum of squares, initial states at their best."""
    size = near[0].slope.shape[2]
    gradient, curvature, cost = np.zeros(size), np.zeros((size, size)), 0.0
    for one in near:
        both = np.concatenate((one.slope, one.residual[:, :, np.newaxis]), axis=2)
        rest = weighting.removed(both, one.start)
        product = rest.T @ rest
        curvature += product[:size, :size]
        gradient += product[:size, size]
        cost += float(product[size, size])
    return gradient, curvature, cost if np.isfinite(cost) else np.inf


def _trials(
    z: Array, gradient: Array, curvature: Array, lower: Array, upper: Array, reach: Array
) -> tuple[Array, float]:
    """Return candidate vectors: steps of every damping and length, kept inside the box.

    The first is the undamped one; the second value is the most that it could bring, were there no
    box.
    """
    held = ((z <= lower) & (gradient < 0)) | ((z >= upper) & (gradient > 0))
    usable = (np.diag(curvature) > 0) & np.isfinite(gradient)
    moving = np.flatnonzero(~held & usable)
    if moving.size == 0 or not np.all(np.isfinite(curvature)):
        return z[np.newaxis, :], 0.0
    scale = np.sqrt(np.diag(curvature)[moving])
    h = curvature[np.ix_(moving, moving)] / np.outer(scale, scale)
    g = gradient[moving] / scale
    values, vectors = np.linalg.eigh(h)
    kept = values > _SEEN * values[-1]
    along = (vectors.T @ g)[kept]
    steps = []
    for damping in _DAMPINGS:
        step = vectors[:, kept] @ (along / (values[kept] + damping)) / scale
        steps += [length * step for length in _LENGTHS]
    trials = np.repeat(z[np.newaxis, :], len(steps), axis=0)
    trials[:, moving] += np.clip(steps, -reach[moving], reach[moving])
    return np.clip(trials, lower, upper), float(steps[0] @ gradient[moving])


def result_at(
    problem: Problem, weighting: Weighting, solution: Solution, simulations: int, steps: int
) -> FitResult:
    """Return the model of a solution, with its uncertainty and the effort that it took."""
    near = solution.near or problem.linearize(solution.z)
    residuals = [problem.settled(one, weighting) for one in near]
    predictions = [s.judged - r for s, r in zip(problem.stretches, residuals, strict=True)]
    spread = describe(problem, solution.z, weighting, near)
    model = problem.model_at(solution.z)
    sigmas = {p.name: float(s) for p, s in zip(problem.free, spread.sigma, strict=True)}
    rms = np.sqrt(np.mean(np.concatenate(residuals) ** 2, axis=0))
    return FitResult(
        model=model.with_estimates({}, sigmas),
        success=solution.converged,
        reason=_reason(solution),
        cost=solution.cost,
        weighting=weighting,
        noise=dict(zip(problem.outputs, rms.tolist(), strict=True)),
        residuals=tuple(residuals),
        predictions=tuple(predictions),
        covariance=spread.covariance,
        unidentifiable=spread.unidentifiable,
        information=spread.information,
        warnings=_warnings(model),
        simulations=simulations,
        iterations=steps,
        vector=solution.z,
    )


def _reason(solution: Solution) -> str:
    if not np.isfinite(solution.cost):
        return 'the model cannot be simulated with these parameters; check start values and units'
    if solution.converged:
        return f'converged after {solution.iterations} steps'
    return f'stopped after {solution.iterations} steps without converging; raise `iterations`'


def _warnings(model: Model) -> tuple[str, ...]:
    return tuple(
        f'{p.name} = {p.value:.4g} {p.unit} sits on its bound ({p.lower:.3g} to {p.upper:.3g}); '
        + ('widen the box, or take the effect that it belongs to out of the model' if '.' in p.name
           else 'widen the box, or hold it at a known value if these data do not tell it')
        for p in model.parameters.free
        if p.on_bound
    )  # fmt: skip
