"""Model reference adaptation: the model's parameters go down the gradient of its error.

The motor is the reference, the equation ``x' c`` the adjustable model beside it (series-parallel,
on the same filtered signals), and the normalized law

    c <- c + g G x e / (s^2 + x' G x),    e = y - x' c,

drives their difference to zero: with ``G`` the prior variances the sum of ``(c - c*)' G^-1
(c - c*)`` never grows for ``0 < g < 2`` and an exact equation.  (Landau 1974, A survey of model
reference adaptive techniques, Automatica 10, doi:10.1016/0005-1098(74)90064-8; normalized as in
Ioannou and Sun, Robust Adaptive Control, 1996, chapter 4.)

It costs least of all and has no memory to be lost, but moves only along the regressor: where
parameters are excited unequally, the weak ones take long.  ``s``, a tenth of the largest value,
keeps noise at standstill from moving anything.  The law itself knows no uncertainty; the
covariance given here, ``P <- (I - K x') P (I - K x')' + K r K'``, follows from its gain ``K`` and
holds for any.
"""

from numba import njit
import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.learners.base import Learner, measure, off, weigh

Array = NDArray[np.float64]

_QUICK = 100.0
"""The best excited direction is found in this part of the memory."""
_PRIOR_NOISE = 0.1


class Gradient(Learner):
    """Normalized gradient; see `Learner` for the parameters."""

    def __init__(self, start: Array, sigma: Array, keep: float, block: int) -> None:
        super().__init__(start, sigma, keep, block)
        self._rate = 1.0 - keep**_QUICK
        self._covariance = np.diag(sigma**2)

    def widen(self, sigma: Array) -> None:
        """Know less beforehand."""
        more = np.maximum(sigma, self.prior) ** 2 - self.prior**2
        self._covariance += np.diag(more)
        super().widen(sigma)

    def update(self, x: Array, y: float) -> None:
        """Take regressors (d,) and the value that they explain."""
        _learn(
            self.coefficients, self.prior, self._covariance, self._floor, self._numbers,
            self._rate, float(self._block), x, y,
        )  # fmt: skip

    def covariance(self) -> Array:
        """Return what the gains left of the prior, and brought of the error."""
        return self._covariance.copy()


@njit(cache=True)
def _learn(coefficients, prior, covariance, floor, numbers, rate, block, x, y):  # type: ignore[no-untyped-def]
    """Take one sample, in place."""
    begun, _ = measure(y, prior, floor, numbers)
    if not begun:
        return
    d, error = x.size, off(x, y, coefficients)
    weight = weigh(error, numbers)
    gain, norm = np.empty(d), (_PRIOR_NOISE * numbers[0]) ** 2
    for i in range(d):
        gain[i] = prior[i] ** 2 * x[i]
        norm += gain[i] * x[i]
    for i in range(d):
        gain[i] *= weight * rate / norm
        coefficients[i] += gain[i] * error
    left = np.eye(d)
    for i in range(d):
        for j in range(d):
            left[i, j] -= gain[i] * x[j]
    variance = numbers[1] * block  # a block's errors are one
    covariance[:] = left @ covariance @ left.T
    for i in range(d):
        for j in range(i + 1):
            value = 0.5 * (covariance[i, j] + covariance[j, i]) + gain[i] * variance * gain[j]
            covariance[i, j] = value
            covariance[j, i] = value
