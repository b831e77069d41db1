"""Stretches in which a signal keeps its value."""

import numpy as np
from numpy.typing import NDArray


def runs(values: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return start and length of the stretches of equal values (N,)."""
    edges = np.flatnonzero(np.diff(values) != 0) + 1
    starts = np.concatenate(([0], edges))
    return starts, np.diff(np.append(starts, values.size))
