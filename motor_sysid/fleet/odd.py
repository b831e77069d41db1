"""Values of one parameter in many motors: which lie where the others do not.

Motors of a type scatter about a mean by a share that their own values tell; each value has a
standard error besides.  A motor is tested against all others: weights are those of scatter and
standard error together, what the others deviate from their mean says how far weights and scatter
are right, and the motor's distance from that mean, over what all that makes, follows Student's t
(the externally studentized residual of weighted least squares).  The most distant motor is taken
out and the rest looked at again, up to a third of them; how many are odd is the largest number of
which the last still is, and the level is shared out, each number having half of that of one less.
So two that are odd do not hide each other, as they do if one stops at the first that is not.
(Rosner, Percentage points for a generalized ESD many-outlier procedure, Technometrics 25 (1983),
doi:10.1080/00401706.1983.10487848; scatter after DerSimonian and Laird, Meta-analysis in clinical
trials, Controlled Clinical Trials 7 (1986) 177.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

Array = NDArray[np.float64]

FEWEST = 5
"""Motors below which nothing is said of any: three others say little of their scatter."""


@dataclass(frozen=True)
class Odd:
    """A motor whose value lies where those of the others do not.

    Attributes
    ----------
    index:
        Which one.
    p_value:
        Of so large a distance, if it were like them, among as many motors as there are.
    """

    index: int
    p_value: float


def mean_and_scatter(values: Array, sigmas: Array) -> tuple[float, float]:
    """Return the mean and the standard deviation about it beyond the standard errors.

    Parameters
    ----------
    values, sigmas:
        (n,) values and their standard errors, n at least 2.
    """
    weight = _weights(values, sigmas, 0.0)
    first = float(np.sum(weight * values) / np.sum(weight))
    q = float(np.sum(weight * (values - first) ** 2))
    room = float(np.sum(weight) - np.sum(weight**2) / np.sum(weight))
    scatter = math.sqrt(max((q - (len(values) - 1)) / room, 0.0))
    both = _weights(values, sigmas, scatter)
    return float(np.sum(both * values) / np.sum(both)), scatter


def _weights(values: Array, sigmas: Array, scatter: float) -> Array:
    """Return (n,) one over the variance of each; no error is smaller than rounding."""
    rounding = 1e-9 * float(np.max(np.abs(values))) + 1e-150
    weight: Array = 1.0 / (scatter**2 + np.maximum(sigmas, rounding) ** 2)
    return weight


def odd_ones(values: Sequence[float], sigmas: Sequence[float], level: float) -> list[Odd]:
    """Return the odd ones, the most distant first.

    Parameters
    ----------
    values, sigmas:
        (n,) values of a parameter, or of its logarithm, and their standard errors.
    level:
        Chance that any of them is called odd though all are alike.

    Returns
    -------
    None of them where there are fewer than `FEWEST`.
    """
    x, s = np.asarray(values, dtype=float), np.asarray(sigmas, dtype=float)
    left = list(range(len(x)))
    if len(left) < FEWEST:
        return []
    found: list[Odd] = []
    most = max(len(x) // 3, 1)
    for _ in range(most):
        p_values = _against_the_others(x[left], s[left])
        worst = int(np.argmin(p_values))
        found.append(Odd(left.pop(worst), min(float(p_values[worst]) * len(p_values), 1.0)))
    levels = [level * 2 ** (most - k) / (2**most - 1) for k in range(1, most + 1)]
    fits = [one.p_value <= own for one, own in zip(found, levels, strict=True)]
    return found[: max((k for k, odd in enumerate(fits, 1) if odd), default=0)]


def _against_the_others(values: Array, sigmas: Array) -> Array:
    """Return (n,) p-values of each, tested against all others."""
    weight = _weights(values, sigmas, mean_and_scatter(values, sigmas)[1])
    rest = np.sum(weight) - weight
    mean = (np.sum(weight * values) - weight * values) / rest
    off = weight * (values - mean[:, None]) ** 2  # row: mean of the others of this motor
    dispersion = (np.sum(off, axis=1) - np.diag(off)) / (len(values) - 2)
    spread = np.sqrt((1.0 / weight + 1.0 / rest) * dispersion)
    distance = np.abs(values - mean)
    t = np.divide(distance, spread, out=np.full_like(distance, np.inf), where=spread > 0)
    t[distance == 0] = 0.0
    p_values: Array = 2.0 * student.sf(t, len(values) - 2)
    return p_values
