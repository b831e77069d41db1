"""Upper quantiles of a maximum from few runs: the empirical ones, and a Pareto tail beyond.

What exceeds a high level follows a generalized Pareto distribution.  Its scale and shape come from
the first two L-moments, the confidence limits from drawing as many values again.  The shape is not
allowed below zero: the tail of a gain in BIC falls at least as slowly as an exponential, and a few
runs may look bounded by chance.
(Pickands 1975, doi:10.1214/aos/1176343003; Hosking and Wallis 1987, doi:10.2307/1269343.)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta

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
    fitted = _Tail.of(maxima)
    rng = np.random.default_rng(0)
    spread = np.array(
        [_Tail.of(fitted.draw(maxima.size, rng)).quantile(alpha) for _ in range(_RESAMPLES)]
    )
    lower, upper = np.quantile(spread, [0.025, 0.975], method='nearest')
    return Quantile(fitted.quantile(alpha), float(lower), float(upper))


@dataclass(frozen=True)
class _Tail:
    """Values in rising order, and the Pareto law of those above a level.

    Attributes
    ----------
    ordered:
        (N,) values.
    count:
        How many are above the level.
    shape, scale:
        Of the law; a negative scale says that there is none.
    """

    ordered: Array
    count: int
    shape: float
    scale: float

    @classmethod
    def of(cls, values: Array) -> '_Tail':
        ordered = np.sort(values)
        count = max(round(SHARE * ordered.size), FEWEST)
        level = ordered[-count - 1]
        if not np.isfinite(level):
            return cls(ordered, count, 0.0, -1.0)
        return cls(ordered, count, *_pareto(ordered[-count:] - level))

    def quantile(self, alpha: float) -> float:
        share = self.count / self.ordered.size
        if alpha >= share or self.scale < 0:
            return float(np.quantile(self.ordered, 1.0 - alpha, method='higher'))
        return float(self._beyond(np.array(alpha / share)))

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """Draw from the values below the level and from the law above it."""
        if self.scale < 0:
            return rng.choice(self.ordered, count)
        drawn = rng.choice(self.ordered[: -self.count], count)
        above = rng.uniform(size=count) < self.count / self.ordered.size
        drawn[above] = self._beyond(1.0 - rng.uniform(size=int(above.sum())))
        return drawn

    def _beyond(self, chance: Array) -> Array:
        """Return what is exceeded with that chance, given that the level is."""
        level = self.ordered[-self.count - 1]
        if self.shape < 1e-6:
            return np.asarray(level - self.scale * np.log(chance))
        return np.asarray(level + self.scale / self.shape * (chance**-self.shape - 1.0))


def _pareto(excess: Array) -> tuple[float, float]:
    """Return shape and scale from the L-moments of the (n,) ordered values above the level."""
    n = excess.size
    mean = float(np.mean(excess))
    second = float(2.0 * np.sum(np.arange(n) * excess) / (n * (n - 1)) - mean)
    shape = float(np.clip(2.0 - mean / max(second, 1e-12 + 1e-6 * mean), 0.0, HEAVIEST))
    return shape, (1.0 - shape) * mean


def share_limits(count: int, total: int) -> tuple[float, float]:
    """Return the 95 % limits of a share that was `count` of `total`.

    One-sided where nothing or everything was counted: 3 in `total` is the upper limit of none.
    (Clopper and Pearson 1934, doi:10.1093/biomet/26.4.404.)
    """
    lower = beta.ppf(0.025, count, total - count + 1) if 0 < count < total else 0.0
    upper = beta.ppf(0.975, count + 1, total - count) if 0 < count < total else 1.0
    if count == 0:
        upper = beta.ppf(0.95, 1, total)
    elif count == total:
        lower = beta.ppf(0.05, total, 1)
    return float(lower), float(upper)


def shown_level(values: Array, alpha: float, least: float) -> float:
    """Return the lowest level, at least `least`, that is surely exceeded at most that often.

    Surely: the upper 95 % limit of the share of the (N,) values at or above it is at most `alpha`.
    Infinity if so few values cannot show that of any level.
    """
    ordered = np.sort(values)[::-1]
    allowed = -1
    while allowed + 1 < ordered.size and share_limits(allowed + 1, ordered.size)[1] <= alpha:
        allowed += 1
    if allowed < 0:
        return float('inf')
    beyond = ordered[allowed] if allowed < ordered.size else -np.inf
    return float(max(np.nextafter(beyond, np.inf), least))
