"""Output-error least squares: Levenberg-Marquardt whose every step is one block of simulations.

The Jacobian is made of central differences, 15 parameters to a block of 32 simulations, and a
second block tries 24 steps at once: 12 dampings of two curvatures.
(Marquardt 1963, doi:10.1137/0111030; Dennis, Gay and Welsch 1981, doi:10.1145/355958.355965;
Ljung 1999, sections 7.2 and 10.2.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.problem import Linearization, Problem, weighed
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.estimation.batch.uncertainty import describe
from motor_sysid.estimation.batch.weighting import Weighting, white
from motor_sysid.physics.model import Model
from motor_sysid.physics.parameters import Parameter

Array = NDArray[np.float64]

_DAMPINGS = (0.0, 1e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0, 1e3, 1e4)
SHORTER = 0.4
"""Length of a step in units of one that may go too far."""

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
    rough:
        Whether it stopped because no step lowered the cost any more, though one should have.
    """

    z: Array
    cost: float
    converged: bool
    iterations: int
    simulations: int
    near: tuple[Linearization, ...] = ()
    rough: bool = False


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
    """Minimize the weighted sum of squares by damped Newton steps inside the box.

    Where the undamped step of Gauss and Newton brings most of what it promises it is taken: its
    simulations give the next derivatives as well.  Elsewhere the best of many dampings is, until
    that is an undamped step again; half of those know what the residuals add to the curvature, as
    the gradients of the steps so far tell it: a model that leaves much is bent, and without that
    the steps run to and fro in a valley.  What was best last time is asked first.  It ends where
    the promise falls under `tolerance` times the cost.

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
    here, bend, bent = pose(problem, z, near, weighting), np.zeros((z.size, z.size)), False
    for iteration in range(1, iterations + 1):
        ways = _ways(z, here, bend, bent, lower, upper, problem.reach())
        if not ways.most >= tolerance * here.cost:
            converged = bool(np.isfinite(here.cost))
            return Solution(z, here.cost, converged, iteration, simulations, tuple(near))
        best, enough = 0, False
        if trusted:
            ahead = problem.linearize(ways.trials[0])
            there = pose(problem, ways.trials[0], ahead, weighting)
            simulations += each
            enough = ways.promise > 0 and there.cost < here.cost - ENOUGH * ways.promise
        if not enough:
            costs = problem.costs(ways.trials, weighting, near)
            best = int(np.argmin(costs))
            simulations += len(ways.trials)
            if not costs[best] < here.cost:
                converged = bool(np.isfinite(here.cost))
                return Solution(z, here.cost, converged, iteration, simulations, tuple(near))
        if best > 0 or not trusted:
            ahead = problem.linearize(ways.trials[best])
            there = pose(problem, ways.trials[best], ahead, weighting)
            simulations += each
        other, damping = divmod(best, len(_DAMPINGS))
        trusted, bent = damping == 0, bent ^ bool(other and np.any(bend))
        gain = (here.cost - there.cost) / here.cost if np.isfinite(here.cost) else 1.0
        bend = _bent(bend, ways.trials[best] - z, here, there)
        z, near, here = ways.trials[best], ahead, there
        if gain < tolerance:
            return Solution(z, here.cost, True, iteration, simulations, tuple(near))
    return Solution(z, here.cost, False, iterations, simulations, tuple(near))


@dataclass(frozen=True)
class Posed:
    """A problem at one vector, linearized and weighed.

    Attributes
    ----------
    gradient, curvature, cost:
        Normal equations: (d,), (d, d), and the sum of squares.
    parts:
        (K, d + 1) slopes and residuals of each stretch, weighed, initial states at their best.
    """

    gradient: Array
    curvature: Array
    cost: float
    parts: tuple[Array, ...]


def pose(
    problem: Problem, z: Array, near: Sequence[Linearization], weighting: Weighting
) -> Posed:
    """Return the normal equations of data and prior together, and what they are made of."""
    parts = weighed(near, weighting)
    gradient, curvature, cost = _summed(parts, z.size)
    if problem.prior is not None:
        gradient += problem.precision @ (problem.believed - z)
        curvature += problem.precision
        cost += float(problem.surprise(z[np.newaxis])[0])
    return Posed(gradient, curvature, cost, tuple(parts))


def _bent(bend: Array, step: Array, here: Posed, there: Posed) -> Array:
    """Return what the residuals add to the curvature, after a step.

    The secant update of NL2SOL, sized before it is made (Dennis, Gay and Welsch 1981,
    doi:10.1145/355958.355965); nothing where that says nothing.
    """
    fall = here.gradient - there.gradient  # gradients point downhill
    along = float(fall @ step)
    seen = np.zeros(step.size)
    for before, after in zip(here.parts, there.parts, strict=True):
        seen += (before[:, :-1] - after[:, :-1]).T @ after[:, -1]
    if not (np.all(np.isfinite(seen)) and along > _SEEN * np.sqrt(fall @ fall * (step @ step))):
        return np.zeros_like(bend)
    known = float(step @ bend @ step)
    size = min(1.0, abs(float(step @ seen) / known)) if known != 0.0 else 1.0
    left = seen - size * (bend @ step)
    both = np.outer(left, fall)
    found: Array = (
        size * bend + (both + both.T) / along
        - float(left @ step) * np.outer(fall, fall) / along**2
    )  # fmt: skip
    return found if np.all(np.isfinite(found)) else np.zeros_like(bend)


def normal_equations(
    near: Sequence[Linearization], weighting: Weighting
) -> tuple[Array, Array, float]:
    """Return gradient (d,), curvature (d, d) and sum of squares, initial states at their best."""
    return _summed(weighed(near, weighting), near[0].slope.shape[2])


def newton_step(gradient: Array, curvature: Array) -> Array:
    """Return the undamped step to the minimum; along what the data do not see, none.

    It is not a number where the derivatives are none.
    """
    if not np.all(np.isfinite(curvature)):
        return np.full(gradient.shape, np.nan)
    scale = np.sqrt(np.maximum(np.diag(curvature), 1e-300))
    step = np.linalg.lstsq(curvature / np.outer(scale, scale), gradient / scale, rcond=1e-10)[0]
    return np.asarray(step / scale)


@np.errstate(over='ignore', invalid='ignore')  # what overflows has an infinite cost
def _summed(parts: Sequence[Array], size: int) -> tuple[Array, Array, float]:
    """Return gradient (d,), curvature (d, d) and sum of squares of weighed stretches."""
    total = np.zeros((size + 1, size + 1))
    for part in parts:
        total += part.T @ part
    cost = float(total[size, size])
    return total[:size, size], total[:size, :size], cost if np.isfinite(cost) else np.inf


class _Ways(NamedTuple):
    """Where to go from a vector.

    Attributes
    ----------
    trials:
        (n, d) vectors inside the box, as many of each kind as there are dampings, undamped first.
    most, promise:
        What the first step would bring, were there no box, and what the equations promise for it.
    """

    trials: Array
    most: float
    promise: float


def _ways(
    z: Array, here: Posed, bend: Array, bent: bool, lower: Array, upper: Array, reach: Array
) -> _Ways:
    """Return steps of every damping, those of the `bent` curvature first or last.

    Where there is no bend, the others are shorter.
    """
    gradient, curvature = here.gradient, here.curvature
    held = ((z <= lower) & (gradient < 0)) | ((z >= upper) & (gradient > 0))
    usable = (np.diag(curvature) > 0) & np.isfinite(gradient)
    moving = np.flatnonzero(~held & usable)
    if moving.size == 0 or not np.all(np.isfinite(curvature)):
        return _Ways(z[np.newaxis, :], 0.0, 0.0)
    scale = np.sqrt(np.diag(curvature)[moving])
    first, second = (curvature + bend, curvature) if bent else (curvature, curvature + bend)
    steps = _damped(first, gradient, moving, scale)
    if np.any(bend):
        steps += _damped(second, gradient, moving, scale)
    else:
        steps += [SHORTER * step for step in steps]
    trials = np.repeat(z[np.newaxis, :], len(steps), axis=0)
    trials[:, moving] += np.clip(steps, -reach[moving], reach[moving])
    trials = np.clip(trials, lower, upper)
    step = trials[0] - z
    promise = float(2 * step @ gradient - step @ first @ step)
    return _Ways(trials, float(steps[0] @ gradient[moving]), promise)


def _damped(
    curvature: Array, gradient: Array, moving: NDArray[np.intp], scale: Array
) -> list[Array]:
    """Return the steps of every damping; a saddle is left along what bends down."""
    h = curvature[np.ix_(moving, moving)] / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(h)
    values = np.abs(values)
    kept = values > _SEEN * np.max(values)
    along = (vectors.T @ (gradient[moving] / scale))[kept]
    return [
        vectors[:, kept] @ (along / (values[kept] + damping)) / scale for damping in _DAMPINGS
    ]


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
        success=solution.converged or solution.rough,
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
    steps = f'{solution.iterations} step' + 's' * (solution.iterations != 1)
    if solution.converged:
        return f'converged after {steps}'
    if solution.rough:
        return f'after {steps} no step lowers the error any more'
    return f'stopped after {steps} without converging'


def _warnings(model: Model) -> tuple[str, ...]:
    return tuple(_on_bound(p) for p in model.parameters.free if p.on_bound)


def _on_bound(p: Parameter) -> str:
    remedy = 'take the effect that it belongs to out of the model' if '.' in p.name else (
        'hold it at a known value if these data do not tell it'
    )
    value = f'{p.value:.4g}' if p.unit == '1' else f'{p.value:.4g} {p.unit}'
    box = f'{p.lower:.3g} to {p.upper:.3g}'
    return f'{p.name} = {value} sits on its bound ({box}); widen the box, or {remedy}'
