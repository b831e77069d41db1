"""Estimated parameters as a vector: logarithms of what must be positive, else the values.

Data tell the size of a small friction, not its logarithm: a filter that has learned the logarithm
of ten times too large a friction to 5 % would hold on to 5 % when the value falls.  So what may
be as good as zero is taken as it is.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.parameters import Parameter

Array = NDArray[np.float64]

VANISHING = 1e-11
"""A box that reaches below this (SI) is that of a parameter which may as well be zero."""


class Coordinates:
    """The way between parameter values and coordinates.

    Parameters
    ----------
    parameters:
        The estimated parameters.
    """

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        self.parameters = tuple(parameters)
        self.names = tuple(p.name for p in parameters)
        self.log = np.array([p.lower > VANISHING for p in parameters], dtype=bool)
        self.lower = self.vector([p.lower for p in parameters])
        self.upper = self.vector([p.upper for p in parameters])

    def reach(self, start: Array, factor: float, spread: Array) -> tuple[Array, Array]:
        """Return the coordinates that may be reached from `start`.

        Parameters
        ----------
        start, spread:
            (d,) start and its uncertainty.
        factor:
            Largest change of what must be positive; the others may go twice as many `spread`.
        """
        way = np.where(self.log, np.log(factor), 2 * factor * spread)
        return np.maximum(self.lower, start - way), np.minimum(self.upper, start + way)

    def vector(self, values: Sequence[float]) -> Array:
        """Return the coordinates of values."""
        z = np.array(values, dtype=np.float64)
        z[self.log] = np.log(z[self.log])
        return z

    def values(self, z: Array) -> Array:
        """Return the values of coordinates (..., d)."""
        return np.where(self.log, np.exp(np.where(self.log, z, 0.0)), z)

    def slope(self, z: Array) -> Array:
        """Return the derivative of each value by its coordinate."""
        return np.where(self.log, np.exp(np.where(self.log, z, 0.0)), 1.0)
