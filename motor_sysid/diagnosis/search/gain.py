"""What a refit gains: by how much held-out errors fall, how steadily, and whether beyond doubt."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.diagnosis.where.uneven_records import FEW
from motor_sysid.estimation.batch import Weighting

Array = NDArray[np.float64]

BLOCKS = 20
MIN_STEADY = 0.75
"""Steadiness of a gain over held-out blocks: the sum of what the blocks gain, over that of what
they gain and lose.  It is 1 where no block loses and near 0.5 by chance."""

CERTAIN_GAIN, CERTAIN_STEADY, CERTAIN_T = 10.0, 0.9, 3.0
"""An effect whose gain is lost in the noise of the sensors is believed if the whitened held-out
error falls by this much and either steadily, or by so many standard errors of its block means."""

MOSTLY = 0.5
"""Part of a gain that must be left but for few samples where the states of a motor jump."""


@dataclass(frozen=True)
class Gain:
    """What a refit with one effect more gains.

    Attributes
    ----------
    delta_bic, threshold:
        Gain in BIC, and what it must be.
    asked:
        What noise alone asks of that; `threshold` is more where laws of the model are not right to
        the last detail.
    percent:
        Relative decrease of the held-out error; see `gain_percent`.
    steady:
        Steadiness of that decrease, 0 to 1; see `MIN_STEADY`.
    certain:
        Whether the whitened held-out error falls beyond doubt.
    deep:
        Whether, more than that, it was above the noise and comes near it.
    mends:
        Whether a wider law does more than follow closer what the model has.
    """

    delta_bic: float
    threshold: float
    asked: float
    percent: float
    steady: float
    certain: bool = False
    deep: bool = False
    mends: bool = False


def gain_percent(before: Comparison, after: Comparison) -> float:
    """Return the relative decrease of an error, each output in units of its error before."""
    old, new = before.channel_percent, after.channel_percent
    ratios = [
        _of_nothing(before, after, j) if math.isnan(was) else new[name] / max(was, 1e-12)
        for j, (name, was) in enumerate(old.items())
    ]
    return 100.0 * (1.0 - float(np.sqrt(np.mean([ratio**2 for ratio in ratios]))))


def _of_nothing(before: Comparison, after: Comparison, j: int) -> float:
    """Return the error of output j in units of that before, where no percent of it is known."""
    old, new = (np.sqrt(np.mean(np.concatenate(c.residuals)[:, j] ** 2)) for c in (before, after))
    return float(new / max(old, 1e-300))


def steadiness(before: Comparison, after: Comparison) -> float:
    """Return the steadiness of the gain, with each channel in units of its error before."""
    size = np.sqrt(np.mean(np.concatenate(before.residuals) ** 2, axis=0)) + 1e-300
    pairs = zip(before.residuals, after.residuals, strict=True)
    gains = [np.sum((a / size) ** 2 - (b / size) ** 2, axis=1) for a, b in pairs]
    return _steadiness(_blocks(gains))


def is_certain(before: Comparison, after: Comparison, weighting: Weighting) -> bool:
    """Whether the whitened held-out error falls beyond doubt, however small the gain looks."""
    gains = _blocks([*_gains(before, after, weighting)])
    if not gains.size:
        return False
    error = float(gains.std(ddof=1)) / np.sqrt(gains.size) if gains.size > 1 else np.inf
    sure = _steadiness(gains) >= CERTAIN_STEADY or gains.mean() > CERTAIN_T * error
    return bool(gains.sum() > CERTAIN_GAIN and sure)


def is_in_few(before: Comparison, after: Comparison, weighting: Weighting) -> bool:
    """Whether the whitened held-out error falls, and less than half of that in most samples.

    Of a motor whose states jump at an angle, a touch of anything may put a jump into another one.
    """
    gains = np.concatenate([*_gains(before, after, weighting)])
    rising = gains[np.argsort(np.abs(gains))]
    in_most = np.sum(rising[: gains.size - int(FEW * gains.size)])
    return bool(np.sum(gains) > 0.0 and in_most < MOSTLY * np.sum(gains))


def _gains(before: Comparison, after: Comparison, weighting: Weighting) -> Iterator[Array]:
    """Yield by how much the whitened square of each sample (N,) of each stretch falls."""
    for pair in zip(before.residuals, after.residuals, strict=True):
        old, new = (weighting.flat(r[:, :, np.newaxis])[:, 0] ** 2 for r in pair)
        yield old - new


def _blocks(gains: Sequence[Array]) -> Array:
    """Return sums over about `BLOCKS` blocks of equal length; none of stretches too short."""
    total = sum(g.size for g in gains)
    if not total:
        return np.empty(0)
    pieces = [np.array_split(g, max(round(BLOCKS * g.size / total), 1)) for g in gains]
    return np.array([float(np.sum(piece)) for group in pieces for piece in group])


def _steadiness(gains: Array) -> float:
    return float(np.maximum(gains, 0.0).sum() / max(float(np.abs(gains).sum()), 1e-300))
