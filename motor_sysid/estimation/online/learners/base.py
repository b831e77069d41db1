"""What learns the coefficients of one linear equation, and how much it makes of a sample."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept

Array = NDArray[np.float64]

_PRIOR_NOISE = 0.1
_OUTLIER = 16.0
_TALLEST = 9.0
_MOMENT = 100.0
_LEAST_NOISE = 1e-6

_TOP, _VARIANCE = range(2)


class Learner(ABC):
    """Coefficients ``c`` of an equation ``y = x' c``.

    Parameters
    ----------
    start, sigma:
        (d,) coefficients before any data and their standard deviations.
    keep:
        Weight of a sample that is one sample old: ``exp(-1 / samples of memory)``.
    block:
        Samples of one block; longer than the error is correlated.

    Attributes
    ----------
    coefficients, prior:
        (d,) estimate, and standard deviations before any data.
    """

    def __init__(self, start: Array, sigma: Array, keep: float, block: int) -> None:
        self.coefficients, self.prior = start.copy(), sigma.copy()
        self._keep, self._block = keep, block
        self._floor, self._numbers = np.zeros(start.size), np.zeros(2)

    def widen(self, sigma: Array) -> None:
        """Know less beforehand: raise the standard deviations to `sigma` where it is larger."""
        self.prior[:] = np.maximum(self.prior, sigma)
        self._floor[:] = (_PRIOR_NOISE * self._numbers[_TOP] / self.prior) ** 2

    @abstractmethod
    def update(self, x: Array, y: float) -> None:
        """Take regressors (d,) and the value that they explain."""

    @abstractmethod
    def covariance(self) -> Array:
        """Return the (d, d) covariance of the coefficients."""


@kept()
def measure(y, prior, floor, numbers):  # type: ignore[no-untyped-def]
    """Note how large the values of an equation are.

    What is never forgotten, ``floor`` (d,), is one sample whose error is a tenth of the largest
    value ever seen, spent on the prior.  `numbers` are that value and the variance of the error.

    Returns
    -------
    Whether there were any values but zero so far, and whether this is the first one.
    """
    first = numbers[_TOP] == 0.0
    if abs(y) > 1.1 * numbers[_TOP]:
        numbers[_TOP] = abs(y)
        for i in range(prior.size):
            floor[i] = (_PRIOR_NOISE * numbers[_TOP] / prior[i]) ** 2
        if first:
            numbers[_VARIANCE] = (_PRIOR_NOISE * y) ** 2
    return numbers[_TOP] > 0.0, first and numbers[_TOP] > 0.0


@kept()
def weigh(error, numbers):  # type: ignore[no-untyped-def]
    """Learn the variance of the error; return the sample's weight.

    The weight falls with the square of an error beyond four times the usual.  The usual error is
    never less than a millionth of the largest value: after a standstill without any noise it would
    take as long to learn again what noise is.
    """
    relative = error * error / numbers[_VARIANCE]
    numbers[_VARIANCE] *= 1 + (min(relative, _TALLEST) - 1) / _MOMENT
    numbers[_VARIANCE] = max(numbers[_VARIANCE], (_LEAST_NOISE * numbers[_TOP]) ** 2)
    return min(1.0, _OUTLIER / max(relative, 1e-300))


@kept()
def off(x, y, coefficients):  # type: ignore[no-untyped-def]
    """Return the error of an equation."""
    error = y
    for i in range(x.size):
        error -= x[i] * coefficients[i]
    return error


@kept()
def absorb(information, coefficients, x, error, weight):  # type: ignore[no-untyped-def]
    """Add a sample to the information (d, d) and step to its least squares, in place."""
    d = x.size
    for i in range(d):
        for j in range(d):
            information[i, j] += weight * x[i] * x[j]
    gain = np.linalg.solve(information, x)
    for i in range(d):
        coefficients[i] += gain[i] * weight * error
