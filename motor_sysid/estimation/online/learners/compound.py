"""Compound least squares: long memory while the equation holds, short when its error jumps.

Forgetting is a trade: a long memory averages noise and is late after a change, a short one the
reverse.  A selection decides between the two by the error: where that of the last moment is far
above what is usual, the parameters have changed, and the memory is short until they are found
again.  (After Li and Ma's compound least squares for DC motors, which chooses between plain and
forgetting least squares; the test is the one of variable forgetting, Fortescue, Kershenbaum and
Ydstie 1981, doi:10.1016/0005-1098(81)90070-4.)
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.learners.base import absorb, Learner, measure, off, weigh
from motor_sysid.estimation.online.learners.forgetting import refresh
from motor_sysid.estimation.online.learners.sandwich import add, close, Sandwich
from motor_sysid.machine_code import kept

Array = NDArray[np.float64]

_SHORTER = 50.0
_JUMP, _CALM = 4.0, 1.5
_UP, _DOWN = 100.0, 3.0

_FAST, _USUAL, _SHORT = range(3)


class Compound(Learner):
    """Two memories and a switch; see `Learner` for the parameters.

    The short memory is a fiftieth of the long one.
    """

    def __init__(self, start: Array, sigma: Array, keep: float, block: int) -> None:
        super().__init__(start, sigma, keep, block)
        self._information = np.zeros((start.size, start.size))
        self._sums = Sandwich.empty(start.size, block)
        self._watch = np.zeros(3)

    def update(self, x: Array, y: float) -> None:
        """Take regressors (d,) and the value that they explain."""
        _learn(
            self.coefficients, self.prior, self._information, self._floor, self._numbers,
            self._sums, self._keep, self._watch, x, y,
        )  # fmt: skip

    def covariance(self) -> Array:
        """Return the sandwich."""
        information = self._information
        parts = self.coefficients, information, self._floor, self.prior
        return self._sums.covariance(*parts, self._numbers[0])


@kept()
def _learn(  # type: ignore[no-untyped-def]
    coefficients, prior, information, floor, numbers, sums, keep, watch, x, y
):
    """Take one sample, in place."""
    begun, first = measure(y, prior, floor, numbers)
    if not begun:
        return
    if first:
        information[:] = np.diag(floor)
        watch[_FAST] = watch[_USUAL] = numbers[1]
    error = off(x, y, coefficients)
    weight = weigh(error, numbers)
    _watch_out(weight * error * error, watch, sums.numbers[2])
    if watch[_SHORT]:
        weight = 1.0  # large errors that last are no outliers
    refresh(information, sums.turn, floor, keep**_SHORTER if watch[_SHORT] else keep)
    absorb(information, coefficients, x, error, weight)
    if add(sums, x, y, weight):
        close(sums, coefficients, True)


@kept()
def _watch_out(power, watch, block):  # type: ignore[no-untyped-def]
    """Follow the power of the error over a block and over many; switch where they differ.

    What is usual rises slowly and falls soon: it is that of the equation at its best.
    """
    watch[_FAST] += (power - watch[_FAST]) / block
    growth = watch[_FAST] - watch[_USUAL]
    watch[_USUAL] += growth / ((_UP if growth > 0.0 else _DOWN) * block)
    ratio = watch[_FAST] / max(watch[_USUAL], 1e-300)
    if ratio > _JUMP:
        watch[_SHORT] = 1.0
    elif ratio < _CALM:
        watch[_SHORT] = 0.0
