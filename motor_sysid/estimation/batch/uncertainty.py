"""Uncertainty of a fit, and what the data do not determine."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.problem import Linearization, Problem
from motor_sysid.estimation.batch.weighting import Weighting

Array = NDArray[np.float64]

BLOCKS = 120
"""Stretches of time whose scores count as independent."""

VAGUE = 0.7
"""Relative standard deviation above which a positive parameter counts as undetermined."""

SINGULAR = 1e-9
"""Eigenvalue of the scaled curvature below which a combination counts as unseen."""


@dataclass(frozen=True)
class Spread:
    """Spread of an estimate: sigma (p,), covariance (p, p), and what is undetermined, in words."""

    sigma: Array
    covariance: Array
    unidentifiable: tuple[str, ...]


def describe(
    problem: Problem, z: Array, weighting: Weighting, near: Sequence[Linearization]
) -> Spread:
    """Return the spread at a solution.

    The covariance is ``H^-1 S H^-1`` with ``S`` the sum over time blocks of the outer product of
    each block's score: it holds for errors that are correlated over less than a block.
    (White 1980; Liang and Zeger 1986, doi:10.1093/biomet/73.1.13.)
    """
    curvature, scores = np.zeros((z.size, z.size)), []
    total = sum(len(one.residual) for one in near)
    for one in near:
        both = np.concatenate((one.slope, one.residual[:, :, np.newaxis]), axis=2)
        rest = weighting.removed(both, one.start)
        flat, error = rest[:, :-1], rest[:, -1:]
        curvature += flat.T @ flat
        pieces = max(round(BLOCKS * len(one.residual) / total), 1)
        scores += [part.sum(axis=0) for part in np.array_split(flat * error, pieces)]
    if not np.all(np.isfinite(scores)):
        nothing = np.full(z.size, np.inf)
        return Spread(nothing, np.diag(nothing), ('the model cannot be simulated',))
    size = np.sqrt(np.maximum(np.diag(curvature), 1e-300))
    scaled = curvature / np.outer(size, size)
    inverse = np.linalg.pinv(scaled, rcond=1e-12, hermitian=True)
    pushed = np.array(scores) / size @ inverse / size
    count = len(scores)
    covariance = pushed.T @ pushed * count / max(count - z.size, 1)
    slope = problem.slope(z)
    sigma = np.sqrt(np.diag(covariance)) * np.abs(slope)
    unseen = np.diag(curvature) <= 1e-12 * np.max(np.diag(curvature))
    sigma[unseen] = np.inf
    words = _unidentifiable(problem, scaled, sigma, slope)
    return Spread(sigma, covariance * np.outer(slope, slope), words)


def _unidentifiable(
    problem: Problem, scaled: Array, sigma: Array, slope: Array
) -> tuple[str, ...]:
    names = [p.name for p in problem.free]
    words = []
    values, vectors = np.linalg.eigh(scaled)
    for value, vector in zip(values, vectors.T, strict=True):
        if value < SINGULAR:
            involved = [n for n, v in zip(names, vector, strict=True) if abs(v) > 0.2]
            words.append(
                f'these data see {", ".join(involved)} only in combination; fix one of them'
                if len(involved) > 1
                else f'these data hold no information on {involved[0]}; fix it'
            )
    for p, s, unit_step in zip(problem.free, sigma, slope, strict=True):
        relative = s / abs(unit_step) if p.logarithmic else 0.0
        if relative > VAGUE and not any(p.name in w for w in words):
            words.append(
                f'{p.name} is hardly determined by these data '
                f'(standard deviation {100 * relative:.0f} % of its value)'
            )
    return tuple(words)
