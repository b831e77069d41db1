"""How errors are weighed: the size of each channel's noise, and its colour."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

from motor_sysid.machine_code import kept
from motor_sysid.physics.native import behind, data_of
from motor_sysid.physics.vector import get, put, WIDTH

Array = NDArray[np.float64]

_PIECE = 8192

BURST = 3.0
"""Power of a block of errors, in units of the median block's, above which it counts less."""

STILL, RESTS = 0.1, 0.25
"""Deviation of a block of errors, in units of the least noise, below which its signal rests; and
share of resting blocks from which on they tell nothing of the noise of a signal that moves."""

_BLOCKS, _LONG, _PASSES = 40, 8, 3
"""Blocks; how much longer they are than the order of a noise model at least; passes."""


@dataclass(frozen=True)
class Weighting:
    """Noise model of the outputs.

    Attributes
    ----------
    sigma:
        (n_y,) standard deviation of each output's (whitened) error.
    whiteners:
        For each output the coefficients (order + 1,) of the filter that whitens its error, the
        first one 1; empty for white errors.
    """

    sigma: Array
    whiteners: tuple[Array, ...] = field(default=())

    @cached_property
    def order(self) -> int:
        """Samples that are lost at the start of a stretch."""
        return max((w.size - 1 for w in self.whiteners), default=0)

    @cached_property
    def taps(self) -> Array:
        """The (n_y, order + 1) coefficients that whiten and weigh."""
        taps = np.zeros((self.sigma.size, self.order + 1))
        taps[:, 0] = 1.0
        for row, whitener in zip(taps, self.whiteners, strict=False):
            row[: whitener.size] = whitener
        weighed: Array = taps / self.sigma[:, np.newaxis]
        return weighed

    def rows(self, count: int) -> int:
        """Return how many weighed errors `count` samples give."""
        return max(count - self.order, 0) * self.sigma.size

    def flat(self, values: Array) -> Array:
        """Whiten and weigh (N, n_y, k) along time; return ((N - order) n_y, k)."""
        found = filtered(np.ascontiguousarray(values), self.taps)
        weighed: Array = found.reshape(self.rows(len(values)), values.shape[2])
        return weighed

    def gram(self, values: Sequence[Array], directions: Sequence[Array]) -> Array:
        """Return the (k, k) products of all columns, weighed, summed over stretches.

        What the (N, n_y, m) directions of each stretch explain is taken out of its (N, n_y, k)
        values.  The work is done in pieces: the whole of them together would be large.
        """
        total, taps = np.zeros((values[0].shape[2],) * 2), self.taps
        for one, direction in zip(values, directions, strict=True):
            free = self.flat(direction)
            along = np.zeros((free.shape[1], one.shape[2]))
            width = one.shape[1]
            for a in range(0, len(one) - self.order, _PIECE):
                piece = filtered(one[a : a + _PIECE + self.order], taps).reshape(-1, one.shape[2])
                total += piece.T @ piece
                if free.shape[1]:
                    along += free[a * width : a * width + len(piece)].T @ piece
            if free.shape[1]:
                total -= along.T @ np.linalg.lstsq(free.T @ free, along, rcond=1e-12)[0]
        return total

    def bases(self, directions: Sequence[Array]) -> list[Array]:
        """Return an orthonormal basis (K, m) of the weighed (N, n_y, m) directions of stretches.

        Those of one shape that follow each other are found together.
        """
        found: list[Array] = []
        for _, group in groupby(map(self.flat, directions), key=np.shape):
            found += list(np.linalg.qr(np.stack(list(group)))[0])
        return found

    def removed(self, values: Sequence[Array], directions: Sequence[Array]) -> list[Array]:
        """Weigh (N, n_y, k) of stretches, without what their (N, n_y, m) directions explain."""
        flats = list(map(self.flat, values))
        if not any(one.shape[2] for one in directions):
            return flats
        return [
            flat - q @ (q.T @ flat) for flat, q in zip(flats, self.bases(directions), strict=True)
        ]


@kept(nogil=True, error_model='numpy')
def filtered(values, taps):  # type: ignore[no-untyped-def]
    """Filter (N, n_y, k) along time with (n_y, order + 1) taps; return (N - order, n_y, k).

    Eight rows, and vectors of eight numbers in them, at a time.
    """
    order = taps.shape[1] - 1
    count, outputs, width = values.shape
    rows, row = max(count - order, 0), outputs * width
    found, given = np.empty((rows, outputs, width)), np.ascontiguousarray(values)
    tap = np.empty((order + 1, WIDTH, outputs, width))
    for lag in range(order + 1):
        for j in range(outputs):
            tap[lag, :, j, :] = taps[j, lag]
    whole = rows - rows % WIDTH
    into, at, by = data_of(found), data_of(given), data_of(tap)
    for first in range(0, whole, WIDTH):
        begin = behind(at, (first + order) * row)
        for k in range(0, WIDTH * row, WIDTH):
            total = get(by, k) * get(begin, k)
            for lag in range(1, order + 1):
                total = total + get(by, lag * WIDTH * row + k) * get(begin, k - lag * row)
            put(into, first * row + k, total)
    for t in range(whole, rows):
        for j in range(outputs):
            for k in range(width):
                total_of_one = 0.0
                for lag in range(order + 1):
                    total_of_one += taps[j, lag] * given[t + order - lag, j, k]
                found[t, j, k] = total_of_one
    return found


def white(errors: Sequence[Array], floor: Array | float = 1e-12) -> Weighting:
    """Return the weighting of white errors of the size of (N, n_y) arrays, at least `floor`."""
    joined = np.concatenate(list(errors))
    return Weighting(np.maximum(np.sqrt(np.mean(joined**2, axis=0)), floor))


def coloured(errors: Sequence[Array], order: int, floor: Array | float = 1e-12) -> Weighting:
    """Fit an autoregressive noise model of that order to each column of (N, n_y) errors.

    Yule-Walker, pooled over blocks of the stretches; the estimate is stable by construction.
    Bursts in some of the blocks are what a model lacks, not noise: a block counts as far as its
    power is within `BURST` times the median.  (Huber 1964, doi:10.1214/aoms/1177703732.)  Nor are
    blocks noise in which a signal rests, such as the counts of an encoder, if they are many.
    Stretches of no more samples than the order tell nothing; of such alone the errors are white.
    """
    errors = [error for error in errors if len(error) > order] or list(errors)
    if len(errors[0]) <= order:
        return white(errors, floor)
    whiteners, sigmas = [], []
    least = np.broadcast_to(floor, errors[0].shape[1:])
    for j in range(errors[0].shape[1]):
        blocks = _blocks([error[:, j] - np.mean(error[:, j]) for error in errors], order)
        blocks = _in_motion(blocks, float(least[j]))
        products = np.array([[b[: b.size - k] @ b[k:] for k in range(order + 1)] for b in blocks])
        counts = np.array([b.size for b in blocks], dtype=np.float64)
        weights = np.ones(len(blocks))
        for _ in range(_PASSES):
            covariance = weights @ products / counts.sum()
            covariance[0] = covariance[0] * (1 + 1e-9) + 1e-30
            ar = solve_toeplitz(covariance[:-1], covariance[1:])
            whitener = np.concatenate(([1.0], -ar))
            power = np.array([np.mean(np.convolve(b, whitener, 'valid') ** 2) for b in blocks])
            weights = np.minimum(BURST * np.median(power) / np.maximum(power, 1e-300), 1.0)
        whiteners.append(whitener)
        sigmas.append(np.sqrt(max(float(covariance[0] - ar @ covariance[1:]), 1e-30)))
    return Weighting(np.maximum(np.array(sigmas), floor), tuple(whiteners))


def _in_motion(blocks: list[Array], least: float) -> list[Array]:
    """Return the blocks in which a signal moves; all, if it does in nearly all or in none."""
    moving = [block for block in blocks if np.std(block) > STILL * least]
    return moving if 0 < len(moving) <= (1 - RESTS) * len(blocks) else blocks


def _blocks(errors: Sequence[Array], order: int) -> list[Array]:
    """Cut (N,) errors into about `_BLOCKS` blocks that are much longer than the model's order."""
    longest = max(sum(e.size for e in errors) // _BLOCKS, _LONG * (order + 1))
    return [b for e in errors for b in np.array_split(e, max(round(e.size / longest), 1))]
