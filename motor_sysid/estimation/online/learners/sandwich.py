"""Honest covariances of coefficients whose equation error is strongly correlated.

The textbook variance ``s^2 A^-1`` is then far too small.  The covariance given here is the
sandwich ``A^-1 (sum of g g') A^-1`` over blocks longer than the correlation, with ``g`` the sum of
``x e`` over a block.  (Newey and West 1987, doi:10.2307/1913610.)

What the rule of learning forgets of its information ``A <- T A`` it forgets of the sums, too:
every sample's ``T`` is passed on to the blocks before it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept

Array = NDArray[np.float64]

BLOCKS = 200
"""Blocks whose sums are kept, to be weighed with errors as the present coefficients make them."""

_SAMPLES, _CLOSED = range(2)


class Sandwich(NamedTuple):
    """Sums over blocks; the arrays are changed in place.

    Attributes
    ----------
    present, turn:
        (d, d + 1) sum of ``x [x' y]`` over the present block, (d, d) product of its ``T``.
    blocks, old:
        (N, d, d + 1) the same over the last blocks, round and round; (d, d) sum of ``g g'`` over
        all that were there before.
    early:
        (d + 1, d + 1) sum of ``[x y]' [x y]`` over the first samples.
    numbers:
        (3,) samples, closed blocks, samples of a block.
    """

    present: Array
    turn: Array
    blocks: Array
    old: Array
    early: Array
    numbers: Array

    @classmethod
    def empty(cls, size: int, block: int, count: int = BLOCKS) -> 'Sandwich':
        """Return the sums before any sample, for `size` coefficients and `count` blocks."""
        return cls(
            np.zeros((size, size + 1)), np.eye(size), np.zeros((count, size, size + 1)),
            np.zeros((size, size)), np.zeros((size + 1, size + 1)),
            np.array([0.0, 0.0, float(block)]),
        )  # fmt: skip

    def covariance(
        self, coefficients: Array, information: Array, floor: Array, prior: Array, top: float
    ) -> Array:
        """Return the (d, d) covariance of the coefficients.

        Parameters
        ----------
        coefficients, information:
            (d,) and the (d, d) information in them.
        floor, prior:
            (d,) the part of it that never goes, and standard deviations before any data.
        top:
            Largest value that the equation ever had; an error of a millionth of it is always
            believed.
        """
        if top == 0.0:
            return np.diag(prior**2)
        tiny = 1e-12 * top**2
        return np.asarray(_covariance(self, coefficients, information, floor, prior, tiny))


@kept()
def add(sums, x, y, weight):  # type: ignore[no-untyped-def]
    """Add a weighted sample: regressors (d,) and value.  Return whether a block is full."""
    d, present, early, numbers = x.size, sums.present, sums.early, sums.numbers
    for i in range(d):
        for j in range(d):
            present[i, j] += weight * x[i] * x[j]
        present[i, d] += weight * x[i] * y
    if numbers[_CLOSED] < _many(d):
        for i in range(d):
            for j in range(d):
                early[i, j] += weight * x[i] * x[j]
            early[i, d] += weight * x[i] * y
            early[d, i] += weight * x[i] * y
        early[d, d] += weight * y * y
    numbers[_SAMPLES] += 1
    return numbers[_SAMPLES] % numbers[2] == 0


@kept()
def close(sums, coefficients, fold):  # type: ignore[no-untyped-def]
    """Begin a new block; what the present one forgot is forgotten of those before.

    The block that has to leave goes into the sum of all older ones if `fold`, else it is dropped.
    """
    d, count, numbers = coefficients.size, sums.blocks.shape[0], sums.numbers
    at = int(numbers[_CLOSED]) % count
    if fold and numbers[_CLOSED] >= count:
        g = _gradient(sums.blocks[at], coefficients)
        sums.old[:] += np.outer(g, g)
    sums.old[:] = sums.turn @ sums.old @ sums.turn.T
    for k in range(min(int(numbers[_CLOSED]), count)):
        if k != at:
            sums.blocks[k] = sums.turn @ sums.blocks[k]
    sums.blocks[at] = sums.present
    sums.present[:] = 0.0
    sums.turn[:] = np.eye(d)
    numbers[_CLOSED] += 1


@kept()
def _many(size):  # type: ignore[no-untyped-def]
    """Blocks from which their sums tell a variance."""
    return 2 * size + 4


@kept()
def _gradient(block, coefficients):  # type: ignore[no-untyped-def]
    d = coefficients.size
    g = np.empty(d)
    for i in range(d):
        g[i] = block[i, d]
        for j in range(d):
            g[i] -= block[i, j] * coefficients[j]
    return g


@kept()
def _covariance(sums, coefficients, information, floor, prior, tiny):  # type: ignore[no-untyped-def]
    """Return the sandwich, and what the information that never goes pulls towards the prior."""
    d = coefficients.size
    inverse = np.linalg.inv(information)
    pull = inverse * (floor * prior)
    whole = inverse @ _score(sums, coefficients, information, tiny) @ inverse + pull @ pull.T
    for i in range(d):
        for j in range(i):
            whole[i, j] = 0.5 * (whole[i, j] + whole[j, i])
            whole[j, i] = whole[i, j]
    return whole


@kept()
def _score(sums, coefficients, information, tiny):  # type: ignore[no-untyped-def]
    """Return the variance of ``sum x e``: by blocks, or before there are enough by guess."""
    d, closed = coefficients.size, int(sums.numbers[_CLOSED])
    if closed < _many(d):
        return _guess(sums, coefficients, tiny) * information
    count = min(closed, sums.blocks.shape[0])
    score = sums.turn @ sums.old @ sums.turn.T
    for k in range(count):
        g = sums.turn @ _gradient(sums.blocks[k], coefficients)
        for i in range(d):
            for j in range(d):
                score[i, j] += g[i] * g[j]
    return score * (count / (count - d) * _student(count - d))


@kept()
def _student(freedom):  # type: ignore[no-untyped-def]
    """Return how much a variance of so few degrees of freedom is to be raised.

    Then 1.96 sigma is the 95 % interval of Student's t: the square of its quantile over 1.96,
    within 2 % from 6 degrees on.
    """
    return 1.0 + 2.4 / freedom + 6.0 / freedom**2


@kept()
def _guess(sums, coefficients, tiny):  # type: ignore[no-untyped-def]
    """Take every block for one independent error, of which the coefficients have spent some.

    A fit to few blocks leaves little of the error that it makes.
    """
    d, power = coefficients.size, 0.0
    for i in range(d + 1):
        for j in range(d + 1):
            left = -coefficients[i] if i < d else 1.0
            right = -coefficients[j] if j < d else 1.0
            power += left * sums.early[i, j] * right
    blocks = sums.numbers[_SAMPLES] / sums.numbers[2]
    variance = max(power, 0.0) / max(sums.numbers[_SAMPLES] - d, 1.0)
    spent = max(blocks, 1.0) / max(blocks - d, 1.0)
    return variance * spent * sums.numbers[2] + tiny
