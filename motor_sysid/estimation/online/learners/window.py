"""Least squares over a sliding window: what is older has no weight at all.

    A = A0 + sum of x x',    c = c0 + A^-1 sum of x (y - x' c0)    over the window.

Within a block of samples the window grows by the recursive formula; at its end the oldest block
leaves, and both sums are formed anew from those of the blocks: no rounding error builds up, and
the work does not depend on how many samples the window holds.  ``c0`` is the estimate before that.
(Niedzwiecki, Identification of Time-varying Processes, 2000, chapter 4, on windows; the
prior ``A0`` keeps a window without excitation where it was.)
"""

import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.learners.base import absorb, Learner, measure, off, weigh
from motor_sysid.estimation.online.learners.sandwich import add, BLOCKS, close, Sandwich
from motor_sysid.machine_code import kept

Array = NDArray[np.float64]


class Window(Learner):
    """A window as long as the memory; see `Learner` for the parameters."""

    def __init__(self, start: Array, sigma: Array, keep: float, block: int) -> None:
        super().__init__(start, sigma, keep, block)
        length = -1.0 / math.log(keep) / block if keep < 1.0 else math.inf
        self._information = np.zeros((start.size, start.size))
        self._sums = Sandwich.empty(start.size, block, max(round(min(length, BLOCKS)), 2))

    def update(self, x: Array, y: float) -> None:
        """Take regressors (d,) and the value that they explain."""
        _learn(
            self.coefficients, self.prior, self._information, self._floor, self._numbers,
            self._sums, x, y,
        )  # fmt: skip

    def covariance(self) -> Array:
        """Return the sandwich."""
        information = self._information
        parts = self.coefficients, information, self._floor, self.prior
        return self._sums.covariance(*parts, self._numbers[0])


@kept()
def _learn(coefficients, prior, information, floor, numbers, sums, x, y):  # type: ignore[no-untyped-def]
    """Take one sample, in place."""
    begun, first = measure(y, prior, floor, numbers)
    if not begun:
        return
    if first:
        information[:] = np.diag(floor)
    error = off(x, y, coefficients)
    weight = weigh(error, numbers)
    absorb(information, coefficients, x, error, weight)
    if add(sums, x, y, weight):
        close(sums, coefficients, False)
        _slide(coefficients, information, floor, sums)


@kept()
def _slide(coefficients, information, floor, sums):  # type: ignore[no-untyped-def]
    """Form the sums over the window anew, and solve."""
    d = coefficients.size
    information[:] = np.diag(floor)
    right = np.zeros(d)
    for k in range(sums.blocks.shape[0]):
        block = sums.blocks[k]
        for i in range(d):
            right[i] += block[i, d]
            for j in range(d):
                information[i, j] += block[i, j]
                right[i] -= block[i, j] * coefficients[j]
    coefficients += np.linalg.solve(information, right)
