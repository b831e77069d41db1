"""A linear block in continuous time: any stable poles, held inputs, a delay, exact at samples.

    den(s) = product of (s^2 + d1 s + d0), and (s + d0) where the order is odd,  d > 0.

With logarithms of the d as coordinates every point is a stable block.  Its states are the inputs
through ``s^j / den``, so that numerator, constant and initial state are linear: they are found by
projection, and only poles and delay are searched for.  (Golub and Pereyra 1973,
doi:10.1137/0710036; hold and fractional delay: Astrom and Wittenmark, Computer-Controlled Systems,
3rd ed. 1997, section 2.3.)
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from motor_sysid.machine_code import kept
from motor_sysid.structures.base import Run

Array = NDArray[np.float64]


class Discrete(NamedTuple):
    """A block at its samples: ``x+ = a x + now u[k - lag] + before u[k - lag - 1]``."""

    a: Array
    now: Array
    before: Array
    lag: int


def denominator(poles: Array) -> Array:
    """Return the (n + 1,) coefficients of ``den``, highest first, from (n,) logarithms."""
    den = np.ones(1)
    for k in range(0, poles.size - 1, 2):
        den = np.convolve(den, [1.0, np.exp(poles[k]), np.exp(poles[k + 1])])
    if poles.size % 2:
        den = np.convolve(den, [1.0, np.exp(poles[-1])])
    return den


def discretized(poles: Array, delay: float) -> Discrete:
    """Return the block at its samples.

    Parameters
    ----------
    poles:
        (n,) logarithms of the coefficients, for time in samples.
    delay:
        Delay in samples, not negative.
    """
    den = denominator(poles)
    n = poles.size
    whole = np.zeros((n + 1, n + 1))
    whole[: n - 1, 1:n] = np.eye(n - 1)
    whole[n - 1, :n] = -den[:0:-1]
    whole[n - 1, n] = 1.0
    lag = int(np.floor(delay))
    late = delay - lag
    first, last = expm(whole * late), expm(whole * (1 - late))
    return Discrete(
        last[:n, :n] @ first[:n, :n], last[:n, n].copy(), last[:n, :n] @ first[:n, n], lag
    )


@kept(nogil=True)
def _run(a, now, before, lag, u, x, out):  # type: ignore[no-untyped-def]
    n = x.size
    new = np.empty(n)
    for k in range(u.size):
        for i in range(n):
            out[k, i] = x[i]
        one = u[k - lag] if k >= lag else 0.0
        two = u[k - lag - 1] if k >= lag + 1 else 0.0
        for i in range(n):
            total = now[i] * one + before[i] * two
            for j in range(n):
                total += a[i, j] * x[j]
            new[i] = total
        x[:] = new


def states(block: Discrete, u: Array) -> Array:
    """Return (N, n) states from rest under one input (N,)."""
    out = np.empty((u.size, block.now.size))
    _run(*block, np.ascontiguousarray(u), np.zeros(block.now.size), out)
    return out


def free(block: Discrete, count: int) -> Array:
    """Return (N, n) first state from every unit initial state: all free motions of the block.

    Any output of the block is a combination of its first state and later ones, so of these.
    """
    powers = np.zeros((count, block.now.size))
    _powers(block.a, powers)
    size = np.max(np.abs(powers), axis=0)
    return np.asarray(powers / np.where(size > 0, size, 1.0))


@kept(nogil=True)
def _powers(a, out):  # type: ignore[no-untyped-def]
    n = a.shape[0]
    row, new = np.zeros(n), np.empty(n)
    row[0] = 1.0
    for k in range(len(out)):
        largest = 0.0
        for i in range(n):
            out[k, i] = row[i]
            total = 0.0
            for j in range(n):
                total += row[j] * a[j, i]
            new[i] = total
            largest = max(largest, abs(total))
        row[:] = new
        if largest < 1e-12:
            return


def responses(block: Discrete, u: Array) -> Array:
    """Return (N, n m + 1) what numerators and constant are factors of."""
    parts = [states(block, column) for column in u.T]
    return np.column_stack([*parts, np.ones(len(u))])


def projected(
    poles: Array, delay: float, runs: Sequence[Run], every: int = 1
) -> tuple[Array, Array]:
    """Return the best linear coefficients (n m + 1,) and the residuals of all runs (K,).

    The initial state of every run is taken out of data and responses first.  Of the rows only each
    `every`-th counts.
    """
    block = discretized(poles, delay)
    x, y = [], []
    for run in runs:
        both = np.column_stack([responses(block, run.u), run.y])[::every]
        motion = free(block, len(run))[::every]
        weights = np.linalg.lstsq(motion.T @ motion, motion.T @ both, rcond=1e-13)[0]
        both -= motion @ weights
        x.append(both[:, :-1])
        y.append(both[:, -1])
    regressors, wanted = np.concatenate(x), np.concatenate(y)
    size = np.sqrt(np.sum(regressors**2, axis=0))
    size[size == 0] = 1.0
    scaled = regressors / size
    gram = scaled.T @ scaled
    best = np.linalg.lstsq(gram, scaled.T @ wanted, rcond=1e-13)[0] / size
    return best, wanted - regressors @ best


def settled(block: Discrete, forced: Array, start: Array) -> Array:
    """Return a forced response (N,) with the free motion that the first measured rows ask for."""
    if len(start) == 0:
        return forced
    motion = free(block, len(forced))
    rows = min(len(start), len(forced))
    change = np.linalg.lstsq(motion[:rows], start[:rows, 0] - forced[:rows], rcond=1e-6)[0]
    settled_run: Array = forced + motion @ change
    return settled_run
