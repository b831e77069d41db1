"""What is believed of parameters before the data: a normal prior, which a fit weighs with them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.parameters import Parameter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prior:
    """A normal prior of some parameters.

    Each of them has one coordinate: its logarithm if its box is positive, else its value in SI.

    Attributes
    ----------
    names:
        The m parameters.
    mean:
        (m,) means of their coordinates.
    precision:
        (m, m) inverse covariance; a direction of precision zero is left to the data.
    """

    names: tuple[str, ...]
    mean: Array
    precision: Array

    def placed(self, free: Sequence[Parameter], size: Array) -> tuple[Array, Array]:
        """Return mean (d,) and precision (d, d) for the free parameters of a problem.

        Parameters
        ----------
        free:
            The d free parameters; what the prior says of others is left out.
        size:
            (d,) size of a unit of each coordinate; one for logarithms.
        """
        mean, precision = np.zeros(size.size), np.zeros((size.size, size.size))
        known = {name: k for k, name in enumerate(self.names)}
        pairs = [(j, known[p.name]) for j, p in enumerate(free) if p.name in known]
        if pairs:
            here, there = (np.array(column) for column in zip(*pairs, strict=True))
            mean[here] = self.mean[there] / size[here]
            scale = np.outer(size[here], size[here])
            precision[np.ix_(here, here)] = self.precision[np.ix_(there, there)] * scale
        return mean, precision


def coordinate(parameter: Parameter, value: float) -> float:
    """Return the coordinate of a value of a parameter."""
    return float(np.log(value)) if parameter.logarithmic else value


def coordinate_sigma(parameter: Parameter) -> float:
    """Return the standard deviation of a parameter's coordinate; 0 where none is known."""
    sigma = parameter.sigma or 0.0
    return sigma / parameter.value if parameter.logarithmic else sigma
