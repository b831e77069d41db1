"""Upper quantiles of a maximum from few runs: the empirical ones, and a Pareto tail beyond.

What exceeds a high level follows a generalized Pareto distribution; its scale and shape come from
the first two L-moments.  The shape is not allowed below zero: the tail of a gain in BIC falls at
least as slowly as an exponential, and a few runs may look bounded by chance.
(Pickands 1975, doi:10.1214/aos/1176343003; Hosking and Wallis 1987, doi:10.2307/1269343.)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError

Array = NDArray[np.float64]

SHARE = 0.25
"""Share of the runs that the tail is fitted to, at least `FEWEST`."""

FEWEST = 10
HEAVIEST = 0.5
"""Largest shape: beyond, the variance would be infinite."""

_RESAMPLES = 500


@dataclass(frozen=True)
class Quantile:
    """An upper quantile with its 95 % confidence limits."""

    value: float
    lower: float
    upper: float


def upper_quantile(maxima: Array, alpha: float) -> Quantile:
    """Return the value that is exceeded with probability `alpha`.

    Parameters
    ----------
    maxima:
        (N,) independent values; minus infinity stands for less than all others.
    alpha:
        Probability, between 0 and 1.

    Raises
    ------
    UserError
        If there are fewer than 20 values, or alpha is no probability.
    """
    if not 0.0 < alpha < 1.0:
        raise UserError(f'alpha {alpha:g} is no false-alarm rate; give one between 0 and 1')
    if maxima.size < 2 * FEWEST:
        raise UserError(f'{maxima.size} runs are too few for a threshold; make at least 20')
    rng = np.random.default_rng(0)
    drawn = rng.choice(maxima, (_RESAMPLES, maxima.size))
    spread = np.array([_quantile(one, alpha) for one in drawn])
    lower, upper = np.quantile(spread, [0.025, 0.975], method='nearest')
    return Quantile(_quantile(maxima, alpha), float(lower), float(upper))


def _quantile(maxima: Array, alpha: float) -> float:
    ordered = np.sort(maxima)
    count = max(round(SHARE * ordered.size), FEWEST)
    level = ordered[-count - 1]
    share = count / ordered.size
    if alpha >= share or not np.isfinite(level):
        return float(np.quantile(ordered, 1.0 - alpha, method='higher'))
    shape, scale = _pareto(ordered[-count:] - level)
    rarer = share / alpha
    if shape < 1e-6:
        return float(level + scale * np.log(rarer))
    return float(level + scale / shape * (rarer**shape - 1.0))


def _pareto(excess: Array) -> tuple[float, float]:
    """Return shape and scale from the L-moments of the (n,) ordered values above the level."""
    n = excess.size
    mean = float(np.mean(excess))
    second = float(2.0 * np.sum(np.arange(n) * excess) / (n * (n - 1)) - mean)
    shape = float(np.clip(2.0 - mean / max(second, 1e-12 + 1e-6 * mean), 0.0, HEAVIEST))
    return shape, (1.0 - shape) * mean
