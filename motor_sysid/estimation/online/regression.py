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

from numba import njit
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_PRIOR_NOISE = 0.1
_BLOCKS = 200
_OUTLIER = 16.0
_TALLEST = 9.0
_MOMENT = 100.0

_TOP, _VARIANCE, _COUNT = range(3)


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
    coefficients, prior:
        (d,) estimate, and standard deviations before any data.
    state:
        What `learn` takes: coefficients, prior, (d, d) information, (d,) information that never
        goes, (3,) largest value, variance of the error and number of samples, (d + 1, d + 1)
        moments of the present block, (200, d + 1, d + 1) those of the last blocks, (2,) weight of
        a sample that is one sample old, and samples of a block.
    """

    def __init__(self, start: Array, sigma: Array, keep: float, block: int) -> None:
        d = start.size
        self.coefficients, self.prior = start.copy(), sigma.copy()
        self._floor, self._numbers = np.zeros(d), np.zeros(3)
        self.state = (
            self.coefficients, self.prior, np.zeros((d, d)), self._floor, self._numbers,
            np.zeros((d + 1, d + 1)), np.zeros((_BLOCKS, d + 1, d + 1)),
            np.array([keep, float(block)]),
        )  # fmt: skip

    def widen(self, sigma: Array) -> None:
        """Know less beforehand: raise the standard deviations to `sigma` where it is larger."""
        self.prior[:] = np.maximum(self.prior, sigma)
        self._floor[:] = (_PRIOR_NOISE * self._numbers[_TOP] / self.prior) ** 2

    def update(self, x: Array, y: float) -> None:
        """Take regressors (d,) and the value that they explain."""
        learn(*self.state, x, y)

    def covariance(self) -> Array:
        """Return the (d, d) covariance of the coefficients."""
        if self._numbers[_TOP] == 0.0:
            return np.diag(self.prior**2)
        return np.asarray(_covariance(*self.state))


@njit(cache=True)
def learn(  # type: ignore[no-untyped-def]
    coefficients, prior, information, floor, numbers, moments, blocks, settings, x, y
):
    """Take one sample, in place: regressors (d,) and the value that they explain.

    What is never forgotten is one sample whose error is a tenth of the largest value ever seen,
    spent on the prior.  The weight falls with the square of an error beyond four times the usual.
    """
    d = x.size
    if abs(y) > 1.1 * numbers[_TOP]:
        first = numbers[_TOP] == 0.0
        numbers[_TOP] = abs(y)
        for i in range(d):
            floor[i] = (_PRIOR_NOISE * numbers[_TOP] / prior[i]) ** 2
            if first:
                information[i, i] = floor[i]
        if first:
            numbers[_VARIANCE] = (_PRIOR_NOISE * y) ** 2
    if numbers[_TOP] == 0.0:
        return
    error = y
    for i in range(d):
        error -= x[i] * coefficients[i]
    relative = error * error / numbers[_VARIANCE]
    numbers[_VARIANCE] *= 1 + (min(relative, _TALLEST) - 1) / _MOMENT
    weight = min(1.0, _OUTLIER / max(relative, 1e-300))
    _add(information, moments, floor, x, y, weight, settings[0])
    gain = np.linalg.solve(information, x)
    for i in range(d):
        coefficients[i] += gain[i] * weight * error
    numbers[_COUNT] += 1
    if numbers[_COUNT] % settings[1] == 0:
        blocks[(int(numbers[_COUNT] / settings[1]) - 1) % _BLOCKS] = moments
        moments[:] = 0.0


@njit(cache=True)
def _add(information, moments, floor, x, y, weight, keep):  # type: ignore[no-untyped-def]
    """Add a weighted sample to the information and to the moments of the block."""
    d = x.size
    for i in range(d):
        for j in range(d):
            information[i, j] = keep * information[i, j] + weight * x[i] * x[j]
            moments[i, j] += weight * x[i] * x[j]
        information[i, i] += (1.0 - keep) * floor[i]
        moments[i, d] += weight * x[i] * y
        moments[d, i] = moments[i, d]
    moments[d, d] += weight * y * y


@njit(cache=True)
def _covariance(  # type: ignore[no-untyped-def]
    coefficients, prior, information, floor, numbers, moments, blocks, settings
):
    """Return the sandwich, and what the information that never goes pulls towards the prior."""
    d = coefficients.size
    inverse = np.linalg.inv(information)
    score = _score(coefficients, information, numbers, moments, blocks, settings)
    pull = inverse * (floor * prior)
    whole = inverse @ score @ inverse + pull @ pull.T
    for i in range(d):
        for j in range(i):
            whole[i, j] = 0.5 * (whole[i, j] + whole[j, i])
            whole[j, i] = whole[i, j]
    return whole


@njit(cache=True)
def _score(coefficients, information, numbers, moments, blocks, settings):  # type: ignore[no-untyped-def]
    """Return the variance of ``sum x e``: by blocks, or before there are enough by guess."""
    d, size = coefficients.size, int(settings[1])
    done = int(numbers[_COUNT]) // size
    count = min(done, _BLOCKS)
    if count < 2 * d + 4:
        return _guess(coefficients, information, numbers, moments, blocks[:count], settings)
    score, g = np.zeros((d, d)), np.empty(d)
    fade = settings[0] ** size
    weight = settings[0] ** (int(numbers[_COUNT]) - size * done)
    for back in range(count):
        block = blocks[(done - 1 - back) % _BLOCKS]
        for i in range(d):
            g[i] = block[i, d]
            for j in range(d):
                g[i] -= block[i, j] * coefficients[j]
            g[i] *= weight
        for i in range(d):
            for j in range(d):
                score[i, j] += g[i] * g[j]
        weight *= fade
    return score * (count / (count - d))


@njit(cache=True)
def _guess(coefficients, information, numbers, moments, blocks, settings):  # type: ignore[no-untyped-def]
    """Take every block for one independent sample, and the error as it is."""
    d, power = coefficients.size, 0.0
    for i in range(d + 1):
        for j in range(d + 1):
            total = moments[i, j]
            for block in range(blocks.shape[0]):
                total += blocks[block, i, j]
            left = -coefficients[i] if i < d else 1.0
            right = -coefficients[j] if j < d else 1.0
            power += left * total * right
    variance = max(power, 0.0) / max(numbers[_COUNT] - d, 1.0)
    return (variance * settings[1] + 1e-12 * numbers[_TOP] ** 2) * information
