"""Uncertainty of a fit, and what the data do not determine."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.information import Information, of_curvature
from motor_sysid.estimation.batch.problem import Linearization, Problem, weighed
from motor_sysid.estimation.batch.stationary import stationary_scores
from motor_sysid.estimation.batch.weighting import Weighting

Array = NDArray[np.float64]

BLOCKS = 120
"""Stretches of time whose scores count as independent."""

VAGUE = 0.7
"""Relative standard deviation above which a positive parameter counts as undetermined."""

BOXED = 5.0
"""The same from which on only the box of a parameter tells anything of it."""


@dataclass(frozen=True)
class Spread:
    """Spread of an estimate.

    Attributes
    ----------
    sigma, covariance:
        (p,) and (p, p), in the units of the parameters; `sigma` is infinite where the data see a
        parameter only in combination with others, or not at all.
    unidentifiable:
        What is undetermined, in words.
    information:
        What an estimate could reach with white noise of the size that the weighting says.
    """

    sigma: Array
    covariance: Array
    unidentifiable: tuple[str, ...]
    information: Information


@dataclass(frozen=True)
class Scores:
    """What the data say at one vector, without any prior.

    Attributes
    ----------
    curvature:
        (d, d) sum of squared sensitivities, weighed.
    blocks:
        (K, d) score (gradient of half the negative cost) of each block of time.
    shares:
        (K, d, d) part of each block in the curvature.
    """

    curvature: Array
    blocks: Array
    shares: Array

    @property
    def covariance(self) -> Array:
        """(d, d) covariance of the score, from how it differs between blocks."""
        count, size = self.blocks.shape
        spread: Array = self.blocks.T @ self.blocks * count / max(count - size, 1)
        return spread


def scores_of(near: Sequence[Linearization], weighting: Weighting) -> Scores:
    """Return what the data say at the vector of a linearization."""
    size = near[0].slope.shape[2]
    scores, shares = [], []
    total = sum(len(one.residual) for one in near)
    for one, rest in zip(near, weighed(near, weighting), strict=True):
        pieces = max(round(BLOCKS * len(one.residual) / total), 1)
        products = [part.T @ part for part in np.array_split(rest, pieces)]
        scores += [product[:size, size] for product in products]
        shares += [product[:size, :size] for product in products]
    return Scores(np.sum(shares, axis=0), np.array(scores), np.array(shares))


def describe(
    problem: Problem,
    z: Array,
    weighting: Weighting,
    near: Sequence[Linearization],
    *,
    stationary: bool = False,
) -> Spread:
    """Return the spread at a solution.

    The covariance is ``H^-1 S H^-1`` with ``S`` the sum over time blocks of the outer product of
    each block's score: it holds for errors that are correlated over less than a block, and for
    parameters that many blocks tell of.  (White 1980; Liang and Zeger 1986,
    doi:10.1093/biomet/73.1.13.)  A prior of precision ``P`` adds ``P`` to ``H`` and to ``S``.

    With `stationary` the same is taken of errors that are stationary noise, however long
    correlated, and of what an estimate moves by as each block is left out; each standard deviation
    is the largest of the three, for the sandwich alone says too little where few blocks count.
    (Angrist and Pischke, Mostly Harmless Econometrics, 2009, section 8.1.)
    """
    found = scores_of(near, weighting)
    curvature, scores = found.curvature + problem.precision, found.blocks
    names, slope = [p.name for p in problem.free], problem.slope(z)
    if not np.all(np.isfinite(scores)) or not np.all(np.isfinite(curvature)):
        nothing = np.full(z.size, np.inf)
        told = of_curvature(np.zeros((z.size, z.size)), names)
        return Spread(nothing, np.diag(nothing), ('the model cannot be simulated',), told)
    boxed = curvature + _box_precision(problem)
    size = np.sqrt(np.maximum(np.diag(boxed), 1e-300))
    believed = problem.precision + _box_precision(problem)
    scaled = boxed / np.outer(size, size)
    inverse = np.linalg.pinv(scaled, rcond=1e-12, hermitian=True)
    pushed = scores / size @ inverse / size
    count = len(scores)
    covariance = pushed.T @ pushed * count / max(count - z.size, 1)
    whole = inverse / np.outer(size, size)
    covariance = covariance + whole @ believed @ whole
    if stationary:
        noise = whole @ stationary_scores(near, weighting) @ whole
        covariance = _at_least(covariance, noise + whole @ believed @ whole)
        apart = _jackknife(found, boxed, size)
        covariance = _at_least(covariance, apart + whole @ believed @ whole)
    sigma = np.sqrt(np.diag(covariance)) * np.abs(slope)
    seen, positive = np.diag(curvature), np.array([p.logarithmic for p in problem.free])
    unseen = seen <= 1e-12 * np.where(positive, np.max(seen[positive], initial=0.0), 0.0)
    told = of_curvature(curvature, names, slope)
    sigma[unseen | np.isinf(told.bound)] = np.inf
    words = (*told.words(), *_vague(problem, told.words(), sigma, slope))
    return Spread(sigma, covariance * np.outer(slope, slope), words, told)


def _jackknife(found: Scores, curvature: Array, size: Array) -> Array:
    """Return the (d, d) covariance from how an estimate moves as one block of time is left out.

    Where few blocks tell of a parameter each of them draws the fit to itself, and the scores that
    are left there are too small.  `curvature` (d, d) is that of all, `size` (d,) its root on the
    diagonal.  (Bell and McCaffrey, Survey Methodology 28, 2002, 169-181.)
    """
    scale = np.outer(size, size)
    moves = [
        np.linalg.lstsq((curvature - share) / scale, score / size, rcond=1e-12)[0] / size
        for share, score in zip(found.shares, found.blocks, strict=True)
    ]
    count = len(moves)
    covariance: Array = np.transpose(moves) @ np.array(moves) * (count - 1) / count
    return covariance


def _box_precision(problem: Problem) -> Array:
    """Return the (d, d) precision of what must be positive by its box alone.

    An inductance far below what a sample shows may be a hundred times larger, not a million times:
    without its box, what the others have in common with its derivative, which is rounding, would
    count as theirs.
    """
    lower, upper = problem.box()
    half = [0.5 * (high - low) if p.logarithmic else np.inf
            for p, low, high in zip(problem.free, lower, upper, strict=True)]  # fmt: skip
    return np.diag(np.array(half) ** -2.0)


def _at_least(covariance: Array, other: Array) -> Array:
    """Return a covariance with its correlations, and variances of at least the other's."""
    own = np.maximum(np.diag(covariance), 1e-300)
    factor = np.sqrt(np.maximum(np.diag(other) / own, 1.0))
    raised: Array = covariance * np.outer(factor, factor)
    return raised


def _vague(
    problem: Problem, said: Sequence[str], sigma: Array, slope: Array
) -> tuple[str, ...]:
    """Say which parameters are hardly determined, where nothing was `said` of them yet."""
    words = []
    for p, s, unit_step in zip(problem.free, sigma, slope, strict=True):
        relative = s / abs(unit_step) if p.logarithmic else 0.0
        if relative > VAGUE and not any(p.name in w for w in said):
            share = f' (standard deviation {100 * relative:.0f} % of its value)'
            words.append(
                f'{p.name} is not determined by these data' if relative > BOXED
                else f'{p.name} is hardly determined by these data{share}'
            )  # fmt: skip
    return tuple(words)
