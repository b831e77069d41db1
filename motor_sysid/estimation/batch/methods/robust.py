"""Robust output error: large errors count less.

M-estimates by modified residuals: each measured value is drawn to the model until its error is
``sigma psi(e / sigma)``, and least squares are repeated; the fixed point solves ``sum psi(e /
sigma) slope = 0``, and every round lowers the loss. Sigma is the normalized median of the absolute
errors. (Huber, Robust Statistics, 1981, sections 7.8 and 6.8; Holland and Welsch 1977,
doi:10.1080/03610927708827533 for the constants.)
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.least_squares import fit as fit_output_error
from motor_sysid.estimation.batch.least_squares import result_at, Solution
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.estimation.batch.weighting import Weighting

Array = NDArray[np.float64]

_ROUNDS, _SETTLED = 25, 1e-5
_NORMAL = 1.4826


class Loss(NamedTuple):
    """The derivative of a loss, and its slope, of errors in units of sigma."""

    psi: Callable[[Array], Array]
    slope: Callable[[Array], Array]


LOSSES = {
    'huber': Loss(
        lambda e: np.clip(e, -1.345, 1.345),
        lambda e: (np.abs(e) < 1.345).astype(float),
    ),
    'soft_l1': Loss(
        lambda e: e / np.sqrt(1 + e**2),
        lambda e: (1 + e**2) ** -1.5,
    ),
    'cauchy': Loss(
        lambda e: e / (1 + (e / 2.3849) ** 2),
        lambda e: (1 - (e / 2.3849) ** 2) / (1 + (e / 2.3849) ** 2) ** 2,
    ),
}
"""The losses by name."""


def fit(problem: Problem, loss: Loss) -> FitResult:
    """Fit the output error with a robust loss."""
    now = fit_output_error(problem)
    used, sigma = now, np.ones(len(problem.outputs))
    for _ in range(_ROUNDS):
        errors = np.concatenate(now.residuals)
        sigma = np.maximum(_NORMAL * np.median(np.abs(errors), axis=0), 1e-12)
        drawn = _drawn(problem, now, sigma, loss)
        used = fit_output_error(drawn, Weighting(sigma), start=now.vector, reweight=0)
        moved = float(np.max(np.abs(used.vector - now.vector)))
        solution = Solution(used.vector, used.cost, used.success, used.iterations, 1)
        now = result_at(problem, Weighting(sigma), solution, used.simulations, used.iterations)
        if moved < _SETTLED:
            break
    return _with_spread(now, used, sigma, loss)


def _drawn(problem: Problem, now: FitResult, sigma: Array, loss: Loss) -> Problem:
    """Return the problem with measured values drawn to the model."""
    found = iter(zip(now.predictions, now.residuals, strict=True))
    chains = []
    for chain in problem.chains:
        stretches = []
        for stretch in chain:
            if stretch.scored:
                run, error = next(found)
                measured = stretch.measured.copy()
                measured[stretch.scored_from :] = run + sigma * loss.psi(error / sigma)
                stretch = replace(stretch, measured=measured)
            stretches.append(stretch)
        chains.append(tuple(stretches))
    return Problem(problem.model, chains, problem.outputs, substeps=problem.substeps)


def _with_spread(now: FitResult, used: FitResult, sigma: Array, loss: Loss) -> FitResult:
    """Return the result with the sandwich of the M-estimate: that of psi over its mean slope."""
    errors = np.concatenate(now.residuals) / sigma
    slope = max(float(np.mean(loss.slope(errors))), 0.1)
    sigmas = {p.name: (p.sigma or 0.0) / slope for p in used.model.parameters.free}
    return replace(
        now, model=now.model.with_estimates({}, sigmas), covariance=used.covariance / slope**2
    )
