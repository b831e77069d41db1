"""Recursive least squares that forgets, yet never more than the data can replace.

Information form: with weight ``f`` for a sample that is one sample old,

    A <- f A + (1 - f) A0 + x x',    c <- c + A^-1 x (y - x' c).

``A0`` is the information that never goes: without excitation ``A`` falls back to it and not to
zero, so the covariance is bounded and stays positive definite.  (Forgetting with regularization:
Gunnarsson, IEEE Conf. Decision and Control 1996.)
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.learners.base import absorb, Learner, measure, off, weigh
from motor_sysid.estimation.online.learners.sandwich import add, close, Sandwich
from motor_sysid.machine_code import kept

Array = NDArray[np.float64]


class Forgetting(Learner):
    """Exponential forgetting with what never goes; see `Learner` for the parameters."""

    def __init__(self, start: Array, sigma: Array, keep: float, block: int) -> None:
        super().__init__(start, sigma, keep, block)
        self._information = np.zeros((start.size, start.size))
        self._sums = Sandwich.empty(start.size, block)

    def update(self, x: Array, y: float) -> None:
        """Take regressors (d,) and the value that they explain."""
        _learn(
            self.coefficients, self.prior, self._information, self._floor, self._numbers,
            self._sums, self._keep, x, y,
        )  # fmt: skip

    def covariance(self) -> Array:
        """Return the sandwich."""
        information = self._information
        parts = self.coefficients, information, self._floor, self.prior
        return self._sums.covariance(*parts, self._numbers[0])


@kept()
def _learn(  # type: ignore[no-untyped-def]
    coefficients, prior, information, floor, numbers, sums, keep, x, y
):
    """Take one sample, in place."""
    begun, first = measure(y, prior, floor, numbers)
    if not begun:
        return
    if first:
        information[:] = np.diag(floor)
    error = off(x, y, coefficients)
    weight = weigh(error, numbers)
    refresh(information, sums.turn, floor, keep)
    absorb(information, coefficients, x, error, weight)
    if add(sums, x, y, weight):
        close(sums, coefficients, True)


@kept()
def refresh(information, turn, floor, keep):  # type: ignore[no-untyped-def]
    """Forget a part of the information (d, d), but nothing of its floor (d,)."""
    for i in range(floor.size):
        for j in range(floor.size):
            information[i, j] *= keep
            turn[i, j] *= keep
        information[i, i] += (1.0 - keep) * floor[i]
