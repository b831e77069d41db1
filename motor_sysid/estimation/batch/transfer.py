"""Fit with a prior: the most probable parameters, what came from where, and whether both agree.

The maximum a posteriori fit minimizes the weighted output error plus the weighted distance from
the prior.  Errors that are correlated in time count for less (or more) than their number says:
the weight of the data is set by how their score really spreads (Pauli, Racugno and Ventura,
Statistica Sinica 21, 2011, 149-164).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from motor_sysid.estimation.batch.least_squares import fit_and_slopes
from motor_sysid.estimation.batch.prior import coordinate_sigma
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.estimation.batch.uncertainty import Scores, scores_of
from motor_sysid.estimation.batch.weighting import Weighting
from motor_sysid.physics.parameters import Parameter

Array = NDArray[np.float64]

ALPHA = 0.01
"""How often prior and data are said to contradict each other where they do not."""

PATIENCE = 100
"""Most steps of a minimization: where the data tell little, the way is long and flat."""

_DARK = 1e-9


@dataclass(frozen=True)
class Share:
    """Where one parameter came from.

    Attributes
    ----------
    name, unit:
        The parameter.
    prior, prior_sigma:
        What was believed; NaN and infinite where nothing was.
    value, sigma:
        The estimate.
    data:
        Share of the data: what part of the prior's variance they took away, 0 to 1.
    p_value:
        How often data of a motor that obeys the prior move this parameter further; NaN without a
        prior.
    """

    name: str
    unit: str
    prior: float
    prior_sigma: float
    value: float
    sigma: float
    data: float
    p_value: float


@dataclass(frozen=True)
class Transfer:
    """A fit with a prior.

    Attributes
    ----------
    result:
        The fit.
    shares:
        Where each free parameter came from.
    p_value:
        Of the chi-square test that data and prior agree.
    contradicted:
        Parameters whose data contradict the prior; empty where the test does not reject.
    """

    result: FitResult
    shares: tuple[Share, ...]
    p_value: float
    contradicted: tuple[str, ...]


def transfer(problem: Problem, alpha: float = ALPHA) -> Transfer:
    """Fit a problem that has a prior.

    Parameters
    ----------
    problem:
        Model at the prior's mean, data, and prior.
    alpha:
        How often a contradiction may be reported where there is none.
    """
    first, near = fit_and_slopes(problem, iterations=PATIENCE)
    weighting = _honest(first.weighting, scores_of(near, first.weighting))
    result, near = fit_and_slopes(
        problem, weighting, start=first.vector, reweight=0, near=near, iterations=PATIENCE
    )
    p_value, single = conflict(problem, result.vector, scores_of(near, weighting))
    surprising = [name for name, p in single.items() if p < alpha / max(len(single), 1)]
    if p_value < alpha and not surprising:
        surprising = [min(single, key=lambda name: single[name])]
    named = tuple(surprising) if p_value < alpha else ()
    return Transfer(
        replace(result, warnings=(*result.warnings, *_warning(named, p_value))),
        tuple(
            _share(problem, k, result.model.parameters[p.name], single.get(p.name, np.nan))
            for k, p in enumerate(problem.free)
        ),
        p_value,
        named,
    )


def _honest(weighting: Weighting, scores: Scores) -> Weighting:
    """Return the weighting under which the score spreads as its curvature says, on average."""
    size = np.sqrt(np.maximum(np.diag(scores.curvature), 1e-300))
    scaled = scores.curvature / np.outer(size, size)
    spread = scores.covariance / np.outer(size, size)
    values, vectors = np.linalg.eigh(scaled)
    seen = vectors[:, values > _DARK] / np.sqrt(values[values > _DARK])
    factor = float(np.trace(seen.T @ spread @ seen)) / max(seen.shape[1], 1)
    if not np.isfinite(factor) or factor <= 0:
        return weighting
    return Weighting(weighting.sigma * np.sqrt(factor), weighting.whiteners)


def conflict(problem: Problem, z: Array, scores: Scores) -> tuple[float, dict[str, float]]:
    """Test whether data and prior agree at the most probable vector.

    There the score of the data is what the prior pulls with, so the score at the prior's mean is
    ``(H + P)(z - m)``; it has the covariance ``S + H P^-1 H`` if the motor obeys the prior.  Its
    square is compared with a chi-square distribution (a prior predictive check, Evans and
    Moshonov, Bayesian Analysis 1, 2006, 893-914).  Parameters without a prior are taken out first.

    Returns
    -------
    The p-value of the test, and of each parameter by itself.
    """
    held = np.flatnonzero(np.diag(problem.precision) > 0)
    if held.size == 0:
        return 1.0, {}
    names = [problem.free[k].name for k in held]
    h, s = _profiled(scores, held)
    p = problem.precision[np.ix_(held, held)]
    moved = z[held] - problem.believed[held]
    push = (h + p) @ moved
    spread = s + h @ np.linalg.solve(p, h)
    size = np.sqrt(np.maximum(np.diag(spread), 1e-300))
    values, vectors = np.linalg.eigh(spread / np.outer(size, size))
    seen = values > _DARK
    along = vectors[:, seen].T @ (push / size) / np.sqrt(values[seen])
    whole = np.linalg.solve(h + p, spread) @ np.linalg.inv(h + p)
    score = np.abs(moved) / np.sqrt(np.maximum(np.diag(whole), 1e-300))
    p_value = float(chi2.sf(along @ along, along.size))
    return p_value, dict(zip(names, (2 * norm.sf(score)).tolist(), strict=True))


def _profiled(scores: Scores, held: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return curvature and score covariance of some parameters, the others at their best."""
    other = np.setdiff1d(np.arange(len(scores.curvature)), held)
    h, s = scores.curvature, scores.covariance
    if other.size == 0:
        return h, s
    part = h[np.ix_(held, other)] @ np.linalg.pinv(h[np.ix_(other, other)], hermitian=True)
    mix = np.zeros((held.size, len(h)))
    mix[np.arange(held.size), held] = 1.0
    mix[:, other] = -part
    return mix @ h @ mix.T, mix @ s @ mix.T


def _share(problem: Problem, k: int, fitted: Parameter, p_value: float) -> Share:
    """Return where the k-th free parameter came from; the priors of different ones are apart."""
    precision, prior = float(problem.precision[k, k]), problem.model[fitted.name]
    value, sigma = fitted.value, fitted.sigma or 0.0
    if precision == 0.0:
        return Share(fitted.name, fitted.unit, np.nan, np.inf, value, sigma, 1.0, np.nan)
    believed = float(problem.size[k]) / np.sqrt(precision)
    data = float(np.clip(1 - (coordinate_sigma(fitted) / believed) ** 2, 0.0, 1.0))
    spread = believed * prior if fitted.logarithmic else believed
    return Share(fitted.name, fitted.unit, prior, spread, value, sigma, data, p_value)


def _warning(named: Sequence[str], p_value: float) -> tuple[str, ...]:
    if not named:
        return ()
    return (
        f'data and prior contradict each other in {", ".join(named)} (p = {p_value:.1g}): this '
        'motor differs from its sisters by more than the stated spread; look at it, state a wider '
        'spread, or fit a longer record without a prior',
    )
