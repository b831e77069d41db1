"""Find the moment at which errors become larger or smaller, at a stated false-alarm rate.

The statistic is the generalized likelihood ratio of a change of scale: the energy of the whitened
errors in blocks has one mean before the change and another after it, and the moment is the one
that makes this most likely.  (Basseville and Nikiforov, Detection of Abrupt Changes, 1993, section
2.4.3.)  Its distribution without a change depends on what the errors are like, so it is taken from
the data: blocks in another order are as likely as in this one where nothing changes (permutation
test; Antoch and Huskova, Statistics and Probability Letters 53, 2001, on change points).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCKS = 60
"""Blocks that a record is cut into; a block must outlast what the whitening leaves."""

EDGE = 4
"""Blocks on either side of a change, at least."""

DRAWS = 999
"""Orders of the blocks that the threshold is taken from."""

FEWEST = 20
"""Blocks below which nothing is said."""


@dataclass(frozen=True)
class ChangePoint:
    """A moment at which the size of errors changed.

    Attributes
    ----------
    index:
        First sample after it.
    before, after:
        Mean energy of the errors on either side.
    p_value:
        How often such a contrast comes about where nothing changes.
    """

    index: int
    before: float
    after: float
    p_value: float

    @property
    def ratio(self) -> float:
        """RMS after over RMS before."""
        return float(np.sqrt(self.after / max(self.before, 1e-300)))


def change_point(
    errors: Array, alpha: float, rng: np.random.Generator, blocks: int = BLOCKS
) -> ChangePoint | None:
    """Return where the size of errors changes, or None where it does not.

    Parameters
    ----------
    errors:
        (N, n_y) whitened errors, each output in units of its noise.
    alpha:
        How often a change may be reported where there is none, 0 to 1.
    rng:
        For the orders of the blocks.
    blocks:
        Number of blocks.
    """
    energy = np.mean(errors**2, axis=1)
    size = energy.size // blocks
    if blocks < FEWEST or size < 2:
        return None
    means = energy[: size * blocks].reshape(blocks, size).mean(axis=1)
    means = np.maximum(means, 1e-12 * float(means.max()) + 1e-300)
    observed = _ratios(means[np.newaxis])[0]
    orders = rng.permuted(np.tile(means, (DRAWS, 1)), axis=1)
    exceed = int(np.sum(np.max(_ratios(orders), axis=1) >= np.max(observed)))
    p_value = (1 + exceed) / (1 + DRAWS)
    if p_value > alpha:
        return None
    middle = (int(np.argmax(observed)) + EDGE) * size
    index = _refined(energy, middle - size, middle + size)
    before, after = float(np.mean(energy[:index])), float(np.mean(energy[index:]))
    return ChangePoint(index, before, after, p_value)


def _ratios(means: Array) -> Array:
    """Return the likelihood ratio of a change after each block, (R, B - 2 EDGE + 1)."""
    count = means.shape[1]
    first = np.cumsum(means, axis=1)[:, EDGE - 1 : count - EDGE]
    total = means.sum(axis=1, keepdims=True)
    left = np.arange(EDGE, count - EDGE + 1)
    right = count - left
    ratios: Array = (
        count * np.log(total / count)
        - left * np.log(first / left)
        - right * np.log((total - first) / right)
    )
    return ratios


def _refined(energy: Array, low: int, high: int) -> int:
    """Return the sample between two at which a change is most likely."""
    places = np.arange(max(low, 1), min(high, energy.size - 1))
    first, total, count = np.cumsum(energy)[places - 1], float(energy.sum()), energy.size
    tiny = 1e-300
    likely = places * np.log(first / places + tiny)
    likely += (count - places) * np.log((total - first) / (count - places) + tiny)
    return int(places[np.argmin(likely)])
