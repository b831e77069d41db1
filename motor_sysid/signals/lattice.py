"""The step of a quantized signal: encoder counts, converter bits."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


APART, FEWEST, SHARE = 20.0, 3, 0.1
"""How much wider gaps between levels are than those that printing makes within one; and the least
number and share of them."""


@dataclass(frozen=True)
class Lattice:
    """A signal that takes only multiples of a step.

    Attributes
    ----------
    step:
        Distance of two neighbouring values.
    """

    step: float


def lattice(values: Array) -> Lattice | None:
    """Find the step of a quantized signal, or None where it has too many different values.

    Parameters
    ----------
    values:
        (N,) samples.
    """
    levels = np.unique(values)
    if levels.size < 3 or levels.size > 0.5 * values.size:
        return None
    gaps = np.diff(levels)
    span = levels[-1] - levels[0]
    gaps = _between_levels(gaps[gaps > 1e-9 * span])
    step = float(np.median(gaps[gaps < 1.5 * np.min(gaps)])) if gaps.size else 0.0
    if step <= 0:
        return None
    return Lattice(step) if _are_multiples(gaps, step) else None


def count_of(position: Array) -> float:
    """Return the width of a count of a (N,) position, in its unit; 0 where it has none.

    A position that never comes back shows it in its differences alone.
    """
    found = lattice(np.diff(position))
    return found.step if found else 0.0


def _are_multiples(gaps: Array, step: float) -> bool:
    off = np.abs(gaps / step - np.round(gaps / step))
    return bool(np.mean(off < 0.02 + 1e-3 * gaps / step) > 0.95)


def _between_levels(gaps: Array) -> Array:
    """Return the (K,) gaps without those that few printed digits make of one level.

    An encoder's counts written with four decimals differ by 0.1309 or 0.1310 rad: levels that far
    apart in their tenths lie close together, and the gaps between those are multiples of one step.
    """
    rising = np.sort(gaps)
    if rising.size < 2 * FEWEST:
        return gaps
    ratios = rising[1:] / rising[:-1]
    place = int(np.argmax(ratios))
    wide = rising[place + 1 :]
    apart = ratios[place] > APART and wide.size >= max(FEWEST, SHARE * rising.size)
    return gaps[gaps >= wide[0]] if apart and _are_multiples(wide, float(wide[0])) else gaps
