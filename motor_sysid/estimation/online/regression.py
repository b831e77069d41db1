"""Recursive least squares that forgets, yet never more than the data can replace.

Information form: with weight ``f`` for a sample that is one sample old,

    A <- f A + (1 - f) A0 + x x',    c <- c + A^-1 x (y - x' c).

``A0`` is the information that never goes: without excitation ``A`` falls back to it and not to
zero, so the covariance is bounded and stays positive definite.  (Forgetting with regularization:
Gunnarsson, IEEE Conf. Decision and Control 1996.)

The equation error is strongly correlated, so the textbook variance ``s^2 A^-1`` is far too small.
The covariance given here is the sandwich ``A^-1 (sum of g g') A^-1`` over blocks longer than the
correlation, with ``g`` the sum of ``x e`` over a block.  (Newey and West 1987,
doi:10.2307/1913610.)
"""

from collections import deque

from numba import njit
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_PRIOR_NOISE = 0.1
_BLOCKS = 200
_OUTLIER = 16.0
_TALLEST = 9.0
_MOMENT = 100.0


class Regression:
    """Coefficients of one linear equation.

    Parameters
    ----------
    start, sigma:
        (d,) coefficients before any data and their standard deviations.
    keep:
        Weight of a sample that is one sample old.
    block:
        Samples of one block; longer than the error is correlated.

    Attributes
    ----------
    coefficients:
        (d,) estimate.
    """

    def __init__(self, start: Array, sigma: Array, keep: float, block: int) -> None:
        self.coefficients, self.prior = start.copy(), sigma.copy()
        self._keep, self._size = keep, block
        self._top = self._variance = 0.0
        d = start.size
        self._information = np.zeros((d, d))
        self._floor = np.zeros(d)
        self._blocks: deque[tuple[int, Array]] = deque(maxlen=_BLOCKS)
        self._moments = np.zeros((d + 1, d + 1))
        self._samples = 0

    def widen(self, sigma: Array) -> None:
        """Know less beforehand: raise the standard deviations to `sigma` where it is larger."""
        self.prior = np.maximum(self.prior, sigma)
        self._set_floor()

    def _set_floor(self) -> None:
        """One sample whose error is a tenth of the largest ever seen, spent on the prior."""
        self._floor = (_PRIOR_NOISE * self._top / self.prior) ** 2

    def update(self, x: Array, y: float) -> None:
        """Take regressors (d,) and the value that they explain."""
        if abs(y) > 1.1 * self._top:
            first = self._top == 0.0
            self._top = abs(y)
            self._set_floor()
            if first:
                self._information = np.diag(self._floor)
                self._variance = (_PRIOR_NOISE * y) ** 2
        if self._top == 0.0:
            return
        weight = self._weight(y - float(x @ self.coefficients))
        _update(
            self._information, self.coefficients, self._moments, self._floor, x, y, weight,
            self._keep,
        )  # fmt: skip
        self._samples += 1
        if self._samples % self._size == 0:
            self._blocks.append((self._samples, self._moments))
            self._moments = np.zeros_like(self._moments)

    def _weight(self, error: float) -> float:
        """Return a weight that falls with the square of an error beyond four times the usual."""
        relative = error * error / self._variance
        self._variance *= 1 + (min(relative, _TALLEST) - 1) / _MOMENT
        return min(1.0, _OUTLIER / max(relative, 1e-300))

    def covariance(self) -> Array:
        """Return the (d, d) covariance of the coefficients."""
        if self._top == 0.0:
            return np.diag(self.prior**2)
        inverse = np.linalg.inv(self._information)
        pull = inverse * (self._floor * self.prior)
        whole = inverse @ self._score() @ inverse + pull @ pull.T
        return np.asarray(0.5 * (whole + whole.T))

    def _score(self) -> Array:
        """Return the variance of ``sum x e``: by blocks, or before there are enough by guess."""
        d, c = self.coefficients.size, self.coefficients
        if len(self._blocks) < 2 * d + 4:
            return self._guess()
        age = self._samples - np.array([when for when, _ in self._blocks])
        moments = np.array([block for _, block in self._blocks])
        score = moments[:, :d, d] - moments[:, :d, :d] @ c
        score = score * self._keep**age[:, np.newaxis]
        return np.asarray(score.T @ score * len(self._blocks) / (len(self._blocks) - d))

    def _guess(self) -> Array:
        """Take every block for one independent sample, and the error as it is."""
        moments = self._moments + sum(block for _, block in self._blocks)
        ends = np.append(-self.coefficients, 1.0)
        count = max(self._samples - self.coefficients.size, 1)
        variance = max(float(ends @ moments @ ends), 0.0) / count
        return np.asarray((variance * self._size + 1e-12 * self._top**2) * self._information)


@njit(cache=True)
def _update(  # type: ignore[no-untyped-def]
    information, coefficients, moments, floor, x, y, weight, keep
):
    """Add a weighted sample, in place."""
    d = x.size
    error = y
    for i in range(d):
        error -= x[i] * coefficients[i]
        for j in range(d):
            information[i, j] = keep * information[i, j] + weight * x[i] * x[j]
            moments[i, j] += weight * x[i] * x[j]
        information[i, i] += (1.0 - keep) * floor[i]
        moments[i, d] += weight * x[i] * y
        moments[d, i] = moments[i, d]
    moments[d, d] += weight * y * y
    gain = np.linalg.solve(information, x)
    for i in range(d):
        coefficients[i] += gain[i] * weight * error
