"""Estimated parameters as a vector: logarithms where the box is positive, else the values."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.parameters import Parameter

Array = NDArray[np.float64]


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
        self.log = np.array([p.logarithmic for p in parameters], dtype=bool)
        self.lower = self.vector([p.lower for p in parameters])
        self.upper = self.vector([p.upper for p in parameters])

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

    def clipped(self, z: Array) -> Array:
        """Return the coordinates moved into the box."""
        return np.asarray(np.clip(z, self.lower, self.upper), dtype=np.float64)
