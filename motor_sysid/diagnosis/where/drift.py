"""Errors that drift: what is missing came, went or grew within a record.

A load that sets in once cannot be predicted from the input and does not swing, but the error it
leaves is slower than anything that sensors and random loads make.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.diagnosis.where.uneven_records import by_chain
from motor_sysid.estimation.batch import Chain

Array = NDArray[np.float64]

DRIFT = 0.5
"""Share of the squared error of a record from which on slow errors are missing physics; complete
models with random loads that last 0.1 s reach 0.27 in records of 12 s."""

SLOW = 3
"""Lines of the spectrum that are slow: the mean, and one and two waves in a record."""

_SHORTEST = 256


def drift_of(
    training: Comparison,
    held: Comparison,
    chains: tuple[Sequence[Chain], Sequence[Chain]],
    least: Array,
) -> float:
    """Return the largest share of a record's squared error that is slower than half of it.

    Only outputs count whose error in that record is more than `least` (n_y,).
    """
    residuals = [*by_chain(training.residuals, chains[0]), *by_chain(held.residuals, chains[1])]
    return max((_slow(r, least) for r in residuals if len(r) >= _SHORTEST), default=0.0)


def _slow(residual: Array, least: Array) -> float:
    """Return the share of slow errors among (N, n_y) ones, of the output that has most."""
    squares = np.sum(residual**2, axis=0)
    power = np.abs(np.fft.rfft(residual, axis=0)[:SLOW]) ** 2 / len(residual)
    slow = power[0] + 2.0 * np.sum(power[1:], axis=0)
    counts = squares > len(residual) * least**2
    return float(np.max(np.where(counts, slow / np.maximum(squares, 1e-300), 0.0)))
