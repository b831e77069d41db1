"""Model reference adaptation: the model's parameters go down the gradient of its error.

The motor is the reference, the equation ``x' c`` the adjustable model beside it (series-parallel,
on the same filtered signals).  The plain law, down the gradient of the present error, moves only
along the present regressor: parameters that are excited little take minutes.  So the gradient is
that of the integral of past errors, forgotten with weight ``f``:

    A <- f A + x x',    q <- f q + x y,    c <- c + g D^-1 (q - A c),    D = diag(A).

Scaled like that ``A`` has no eigenvalue beyond its size ``d``, so that with ``g = 1/d`` every step
goes down, and under persistent excitation the parameters converge exponentially.  No equation is
ever solved.  (Landau 1974, A survey of model reference adaptive techniques, Automatica 10,
doi:10.1016/0005-1098(74)90064-8; Kreisselmeier 1977, Adaptive observers with exponential rate of
convergence, IEEE Transactions on Automatic Control 22; Ioannou and Sun, Robust Adaptive Control,
1996, section 4.3.5.)

What never goes of ``A`` is as in `forgetting`.  The law itself knows no uncertainty: the
covariance given is that of least squares with the same memory, and how far it still is to these.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.learners.base import Learner, measure, off, weigh
from motor_sysid.estimation.online.learners.forgetting import refresh
from motor_sysid.estimation.online.learners.sandwich import add, close, Sandwich
from motor_sysid.machine_code import kept

Array = NDArray[np.float64]


class Gradient(Learner):
    """Gradient of the integral of past errors; see `Learner` for the parameters."""

    def __init__(self, start: Array, sigma: Array, keep: float, block: int) -> None:
        super().__init__(start, sigma, keep, block)
        self._start = start.copy()
        self._information = np.zeros((start.size, start.size))
        self._target = np.zeros(start.size)
        self._sums = Sandwich.empty(start.size, block)

    def update(self, x: Array, y: float) -> None:
        """Take regressors (d,) and the value that they explain."""
        _learn(
            self.coefficients, self._start, self.prior, self._information, self._target,
            self._floor, self._numbers, self._sums, self._keep, x, y,
        )  # fmt: skip

    def covariance(self) -> Array:
        """Return the sandwich, and the square of what is left of the way."""
        if self._numbers[0] == 0.0:
            return np.diag(self.prior**2)
        away = self._target - self._information @ self.coefficients
        left = np.linalg.solve(self._information, away)
        parts = self.coefficients + left, self._information, self._floor, self.prior
        return self._sums.covariance(*parts, self._numbers[0]) + np.outer(left, left)


@kept()
def _learn(  # type: ignore[no-untyped-def]
    coefficients, start, prior, information, target, floor, numbers, sums, keep, x, y
):
    """Take one sample, in place."""
    begun, first = measure(y, prior, floor, numbers)
    if not begun:
        return
    d = x.size
    if first:
        information[:] = np.diag(floor)
        target[:] = floor * start
    weight = weigh(off(x, y, coefficients), numbers)
    refresh(information, sums.turn, floor, keep)
    for i in range(d):
        target[i] = keep * target[i] + (1.0 - keep) * floor[i] * start[i] + weight * x[i] * y
        for j in range(d):
            information[i, j] += weight * x[i] * x[j]
    away = target - information @ coefficients
    for i in range(d):
        coefficients[i] += away[i] / (d * information[i, i])
    if add(sums, x, y, weight):
        close(sums, coefficients, True)
