"""The step of a quantized signal: encoder counts, converter bits."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
    gaps = gaps[gaps > 1e-9 * span]
    step = float(np.median(gaps[gaps < 1.5 * np.min(gaps)])) if gaps.size else 0.0
    if step <= 0:
        return None
    off = np.abs(gaps / step - np.round(gaps / step))
    return Lattice(step) if np.mean(off < 0.02 + 1e-3 * gaps / step) > 0.95 else None
