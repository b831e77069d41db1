"""A swing in what is left: one frequency in training and held-out data alike.

A load that swings of itself, or a belt that rings, cannot be predicted from the input; noise and
random loads have no line in their spectrum.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.estimation.batch import Chain

Array = NDArray[np.float64]

CYCLES = 8
"""Fewest swings in a stretch: what is slower may be the drift of a random load."""

LINE, REACH = 200.0, 20
"""Power of a line in units of the median of its surroundings, which reach so many lines to either
side; noise has 200 once in 1e60."""

_LOBE = 2
_SHORTEST = 256


@dataclass(frozen=True)
class Swing:
    """A swing of what is left.

    Attributes
    ----------
    frequency:
        In Hz.
    share:
        Of the squared error of an output, in the data where that is less.
    """

    frequency: float
    share: float


def swing_of(
    training: Comparison, held: Comparison, chains: tuple[Sequence[Chain], Sequence[Chain]]
) -> Swing | None:
    """Return the strongest swing that both comparisons over their chains show, if there is one."""
    found: list[Swing] = []
    for j in range(held.residuals[0].shape[1]):
        first = list(_lines(training, chains[0], j))
        for one, width in _lines(held, chains[1], j):
            found += [
                Swing(one.frequency, min(one.share, other.share))
                for other, wider in first
                if abs(other.frequency - one.frequency) < max(width, wider)
            ]
    return max(found, key=lambda swing: swing.share, default=None)


def _lines(
    comparison: Comparison, chains: Sequence[Chain], output: int
) -> Iterator[tuple[Swing, float]]:
    """Yield the line of each stretch that has one, and the width of a line there in Hz."""
    stretches = [s for chain in chains for s in chain if s.scored]
    for stretch, residual in zip(stretches, comparison.residuals, strict=True):
        duration = stretch.drive.dt * len(residual)
        line = _strongest(residual[:, output]) if len(residual) >= _SHORTEST else None
        if line:
            yield Swing(line[0] / duration, line[1]), 1.0 / duration


def _strongest(values: Array) -> tuple[float, float] | None:
    """Return number and share of the strongest line of (N,) values, if it stands out."""
    waves = np.fft.rfft((values - values.mean()) * np.hanning(values.size))
    power = np.abs(waves) ** 2
    power[:CYCLES] = 0.0
    k = int(np.argmax(power))
    lobe = slice(max(k - _LOBE, 0), k + _LOBE + 1)
    near = power[max(k - REACH, CYCLES) : k + REACH + 1]
    if near.size < REACH or power[k] <= LINE * np.median(near):
        return None
    place = float(np.average(np.arange(power.size)[lobe], weights=power[lobe]))
    everything = np.sum(np.abs(waves[1:]) ** 2)
    return place, float(np.sum(power[lobe]) / everything)
