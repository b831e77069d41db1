"""Recursive least squares that forgets only where a sample brings something new.

Exponential forgetting loses what is not excited.  Here a sample weighs down the information that
there is along its own regressor, and nothing else,

    B <- B - p x x' / (x' B^-1 x) + x x',    A = A0 + B,    c <- c + A^-1 x (y - x' c),

so that in a direction that goes on being excited the balance is that of exponential forgetting.
With ``p = d (1 - f)`` the memory is the same: a sample has but one of ``d`` directions.  (Kulhavy
1987, Restricted exponential forgetting, Automatica 23, doi:10.1016/0005-1098(87)90054-5.  Cao and
Schwartz 2000, doi:10.1016/S0005-1098(00)00093-5, split the information with ``B x`` in place of
``x``, which depends on the units of the parameters.)

Both bounds of the covariance always hold: the information is at least ``A0``, what never goes, and
at most what the memory holds.  ``A0`` grows with the largest value seen, and comes in as the
memory passes, as in `forgetting`: at once it would tie a coefficient that is excited little to
what the first samples made of it.  As Cao and Schwartz have it, nothing is forgotten for a
regressor that is as good as zero; otherwise the noise of a motor at standstill would empty the
matrix.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.learners.base import absorb, Learner, measure, off, weigh
from motor_sysid.estimation.online.learners.sandwich import add, close, Sandwich
from motor_sysid.machine_code import kept

Array = NDArray[np.float64]

_DEAD = 0.02
"""A regressor that could not explain this part of the largest value brings nothing."""
_START = 1e-3
_MOST = 0.5


class Directional(Learner):
    """Directional forgetting with bounds of the covariance; see `Learner` for the parameters."""

    def __init__(self, start: Array, sigma: Array, keep: float, block: int) -> None:
        super().__init__(start, sigma, keep, block)
        self._learned = np.zeros((start.size, start.size))
        self._held = np.zeros(start.size)
        self._sums = Sandwich.empty(start.size, block)

    def update(self, x: Array, y: float) -> None:
        """Take regressors (d,) and the value that they explain."""
        _learn(
            self.coefficients, self.prior, self._learned, self._held, self._floor, self._numbers,
            self._sums, self._keep, x, y,
        )  # fmt: skip

    def covariance(self) -> Array:
        """Return the sandwich."""
        information = self._learned + np.diag(self._held)
        parts = self.coefficients, information, self._floor, self.prior
        return self._sums.covariance(*parts, self._numbers[0])


@kept()
def _learn(  # type: ignore[no-untyped-def]
    coefficients, prior, learned, held, floor, numbers, sums, keep, x, y
):
    """Take one sample, in place."""
    begun, first = measure(y, prior, floor, numbers)
    if not begun:
        return
    if first:
        held[:] = floor
        learned[:] = _START * np.diag(floor)
    for i in range(x.size):
        held[i] += (1.0 - keep) * (floor[i] - held[i])
    error = off(x, y, coefficients)
    weight = weigh(error, numbers)
    _forget_along(x, prior, numbers[0], learned, sums, keep)
    whole = learned + np.diag(held)
    absorb(whole, coefficients, x, error, weight)
    for i in range(x.size):
        for j in range(x.size):
            learned[i, j] += weight * x[i] * x[j]
    if add(sums, x, y, weight):
        close(sums, coefficients, True)


@kept()
def _forget_along(x, prior, top, learned, sums, keep):  # type: ignore[no-untyped-def]
    """Forget along the regressor: ``B <- T B`` with ``T = I - p x x' B^-1 / (x' B^-1 x)``."""
    d, reach, spread = x.size, 0.0, 0.0
    gain = np.linalg.solve(learned, x)
    for i in range(d):
        reach += (x[i] * prior[i]) ** 2
        spread += x[i] * gain[i]
    if reach < (_DEAD * top) ** 2 or not spread > 0.0:
        return
    share = min(d * (1.0 - keep), _MOST) / spread
    for i in range(d):
        for j in range(d):
            learned[i, j] -= share * x[i] * x[j]
    for table in (sums.turn, sums.present):
        along = gain @ table
        for i in range(d):
            for j in range(along.size):
                table[i, j] -= share * x[i] * along[j]
