"""Static bends before and after a linear block: Hammerstein, Wiener and both.

    f(v) = v + sum of c_k (|v - kappa_k| - |kappa_k|)

A bend is a broken line through zero with fixed knots; its overall gain belongs to the block.  All
coefficients are fitted together by the output error, from the linear transfer function and
straight lines.  (Billings and Fakhouri 1982, doi:10.1016/0005-1098(82)90022-X; Bai 1998,
doi:10.1016/S0005-1098(97)00198-2.)
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from motor_sysid.structures.base import Numbers, Run, START_ROWS
from motor_sysid.structures.block import discretized, free, projected, responses, settled
from motor_sysid.structures.transfer_function import search

Array = NDArray[np.float64]

_KNOTS = 13
_REACH = 2.0
_MOST = 15
_RIDGE = 1e-3


class Bent(NamedTuple):
    """A block of n poles with bends of k knots before it (each input) and after it, or none."""

    poles: Array
    delay: float
    numerator: Array
    before: Array
    after: Array


def knots() -> Array:
    """Return the (k,) knots, in units of the RMS of the signal."""
    return np.linspace(-_REACH, _REACH, _KNOTS)


def bend(values: Array, coefficients: Array) -> Array:
    """Return the bent values, of the shape of `values`; straight without coefficients."""
    bent = values.copy()
    for knot, c in zip(knots(), coefficients, strict=False):
        bent += c * (np.abs(values - knot) - abs(knot))
    return bent


def fit(runs: Sequence[Run], order: int, *, before: bool, after: bool) -> Numbers:
    """Fit a block with bends before or after it; see `motor_sysid.structures.base.Kind.fit`."""
    poles, delay = search(runs, order)
    numerator, _ = projected(poles, delay, runs)
    inputs = runs[0].u.shape[1]
    shape = (inputs if before else 0, _KNOTS)
    start = Bent(poles, delay, numerator, np.zeros(shape), np.zeros(_KNOTS if after else 0))
    size = np.maximum(np.abs(numerator), 1e-3 * np.max(np.abs(numerator)))

    def residual(z: Array) -> Array:
        one = _unpacked(z, start, size)
        left = [run.y[:, 0] - _output(one, run.u, run.y[:START_ROWS]) for run in runs]
        keep = _RIDGE * np.concatenate([one.before.ravel(), one.after])
        return np.concatenate([*left, keep * np.sqrt(sum(map(len, runs)))])

    found = least_squares(residual, _packed(start, size), max_nfev=_MOST, xtol=1e-7, ftol=1e-8)
    best = _unpacked(np.asarray(found.x), start, size)
    return {name: np.atleast_1d(np.asarray(v, dtype=float)) for name, v in best._asdict().items()}


def _packed(one: Bent, size: Array) -> Array:
    return np.concatenate([one.poles, one.numerator / size, one.before.ravel(), one.after])


def _unpacked(z: Array, like: Bent, size: Array) -> Bent:
    edges = np.cumsum([like.poles.size, like.numerator.size, like.before.size])
    poles, numerator, before, after = np.split(z, edges)
    return Bent(
        np.clip(poles, -60.0, 6.0), like.delay, numerator * size,
        before.reshape(like.before.shape), after,
    )  # fmt: skip


def _output(one: Bent, u: Array, start: Array) -> Array:
    """Return the (N,) free run; the free motion is read behind the linear block if it is last."""
    bent = u
    if one.before.size:
        pairs = zip(u.T, one.before, strict=True)
        bent = np.column_stack([bend(column, row) for column, row in pairs])
    block = discretized(one.poles, one.delay)
    linear = responses(block, bent) @ one.numerator
    if one.after.size == 0:
        return settled(block, linear, start)
    return bend(_through_bend(one, linear, block_motion=free(block, len(u)), start=start),
                one.after)  # fmt: skip


def _through_bend(one: Bent, linear: Array, block_motion: Array, start: Array) -> Array:
    """Return the linear run with the free motion that two Gauss-Newton steps find."""
    rows = min(len(start), len(linear))
    if rows == 0:
        return linear
    run = linear
    for _ in range(2):
        step = 1e-4
        slope = (bend(run[:rows] + step, one.after) - bend(run[:rows] - step, one.after)) / (
            2 * step
        )
        left = start[:rows, 0] - bend(run[:rows], one.after)
        change = np.linalg.lstsq(block_motion[:rows] * slope[:, np.newaxis], left, rcond=1e-6)[0]
        run = run + block_motion @ change
    return run


def simulate(numbers: Numbers, u: Array, start: Array) -> Array:
    """Run freely; see `motor_sysid.structures.base.Kind.simulate`."""
    before = numbers['before']
    one = Bent(
        numbers['poles'], float(numbers['delay'][0]), numbers['numerator'],
        before.reshape(-1, _KNOTS), numbers['after'],
    )  # fmt: skip
    return _output(one, u, start)[:, np.newaxis]
