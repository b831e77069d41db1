"""Polynomial NARX: terms by orthogonal forward regression, coefficients by the free run.

    y[k] = sum of c_j times a product of at most three of y[k-1 ...], u[k-1 ...]

Terms are added by the error reduction ratio, and the number that runs best freely is kept; then
the coefficients are fitted to the free run, for the equation error is biased by noise.  (Chen,
Billings and Luo 1989, doi:10.1080/00207178908953472; Piroddi and Spinelli 2003,
doi:10.1080/00207170310001635419.)
"""

from collections.abc import Sequence
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from motor_sysid.machine_code import kept
from motor_sysid.structures.base import Kind, Numbers, Run
from motor_sysid.structures.polynomial import best_delay

Array = NDArray[np.float64]

_DEGREE = 3
_SIZES = (4, 8, 12)
_RUNAWAY = 1e3
_MOST = 8


class Narx(Kind):
    """Polynomials of up to third degree in delayed outputs and inputs."""

    key = 'narx'
    title = 'NARX (polynomial)'
    source = 'Chen, Billings and Luo, Int. J. Control 1989'
    limits = 'smooth in the signals: dry friction is approximated; extrapolates badly'
    orders = (1, 2)
    strides = (1, 5, 20)

    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Fit; see `Kind.fit`."""
        delay = best_delay(runs)
        lags = _lags(order, delay, runs[0].u.shape[1])
        table = np.array(_exponents(len(lags)), dtype=float)
        rows = [_rows(run, lags) for run in runs]
        regressors = np.concatenate([_products(row, table) for row in rows])
        wanted = np.concatenate([run.y[lags[:, 1].max() :, 0] for run in runs])
        chosen = forward(regressors, wanted, _SIZES[-1])
        tried = []
        for size in _SIZES:
            first = chosen[:size]
            factors = np.linalg.lstsq(regressors[:, first], wanted, rcond=1e-10)[0]
            one = {'lags': lags.astype(float), 'exponents': table[first], 'factors': factors}
            tried.append((_cost(one, runs), one))
        tried.sort(key=lambda pair: pair[0])
        return _polished(tried[0][1], runs)

    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Run freely; see `Kind.simulate`."""
        return _free(numbers, u, start)[:, np.newaxis]

    def predict(self, numbers: Numbers, run: Run, dt: float) -> Array:
        """Predict; see `Kind.predict`."""
        lags = numbers['lags'].astype(int)
        ahead = run.y.copy()
        ahead[lags[:, 1].max() :, 0] = (
            _products(_rows(run, lags), numbers['exponents']) @ numbers['factors']
        )
        return ahead


def _lags(order: int, delay: int, inputs: int) -> NDArray[np.int64]:
    """Return (V, 2) column (0 the output, then the inputs) and lag of each variable."""
    own = [(0, k + 1) for k in range(order)]
    return np.array(own + [(j + 1, delay + k) for j in range(inputs) for k in range(order)])


def _exponents(variables: int) -> list[list[int]]:
    """Return every product of at most three variables, as exponents."""
    table = []
    for degree in range(_DEGREE + 1):
        for chosen in combinations_with_replacement(range(variables), degree):
            table.append([chosen.count(v) for v in range(variables)])
    return table


def _rows(run: Run, lags: NDArray[np.int64]) -> Array:
    """Return (N - lost, V) values of the variables."""
    lost = int(lags[:, 1].max())
    both = np.column_stack([run.y[:, :1], run.u])
    return np.column_stack([both[lost - lag : len(both) - lag, j] for j, lag in lags])


def _products(rows: Array, table: Array) -> Array:
    columns = [_product(rows, exponents) for exponents in table]
    return np.column_stack(columns)


def _product(rows: Array, exponents: Array) -> Array:
    """Return (K,) the product of the columns of (K, V), each as often as its exponent says."""
    total = np.ones(len(rows))
    for column, times in zip(rows.T, exponents.astype(int), strict=True):
        for _ in range(times):
            total = total * column
    return total


def forward(x: Array, y: Array, count: int) -> list[int]:
    """Return the columns of x (K, M) that reduce the error of y (K,) most, one after the other."""
    left = x.copy()
    chosen: list[int] = []
    first = np.sum(x**2, axis=0)
    for _ in range(min(count, x.shape[1])):
        size = np.sum(left**2, axis=0)
        usable = size > 1e-10 * np.maximum(first, 1e-300)
        gain = np.where(usable, (y @ left) ** 2 / np.maximum(size, 1e-300), -1.0)
        gain[chosen] = -1.0
        best = int(np.argmax(gain))
        if gain[best] <= 0:
            break
        chosen.append(best)
        unit = left[:, best] / np.sqrt(size[best])
        left = left - np.outer(unit, unit @ left)
    return chosen


def _free(numbers: Numbers, u: Array, start: Array) -> Array:
    """Return the (N,) free run, from the first measured outputs or from rest."""
    lags = numbers['lags'].astype(np.int64)
    lost = int(lags[:, 1].max())
    begin = np.zeros(lost)
    begin[: len(start)] = start[:lost, 0] if len(start) else 0.0
    out = np.zeros(len(u))
    out[:lost] = begin[: len(u)]
    _loop(
        lags, np.ascontiguousarray(numbers['exponents'].astype(np.int64)), numbers['factors'],
        np.ascontiguousarray(u), lost, _RUNAWAY, out,
    )  # fmt: skip
    return out


def _cost(numbers: Numbers, runs: Sequence[Run]) -> float:
    return sum(float(np.sum((r.y[:, 0] - _free(numbers, r.u, r.y)) ** 2)) for r in runs)


def _polished(one: Numbers, runs: Sequence[Run]) -> Numbers:
    """Return the structure with factors that run best freely."""
    factors = one['factors']
    size = np.maximum(np.abs(factors), 1e-6)

    def residual(z: Array) -> Array:
        now = {**one, 'factors': z * size}
        return np.concatenate([r.y[:, 0] - _free(now, r.u, r.y) for r in runs])

    found = least_squares(residual, factors / size, max_nfev=_MOST)
    best = {**one, 'factors': np.asarray(found.x) * size}
    return best if _cost(best, runs) < _cost(one, runs) else one


@kept(nogil=True)
def _loop(lags, exponents, factors, u, lost, runaway, out):  # type: ignore[no-untyped-def]
    for k in range(lost, out.size):
        total = 0.0
        for j in range(factors.size):
            term = factors[j]
            for v in range(exponents.shape[1]):
                if exponents[j, v] > 0:
                    at = k - lags[v, 1]
                    value = out[at] if lags[v, 0] == 0 else u[at, lags[v, 0] - 1]
                    for _ in range(exponents[j, v]):
                        term *= value
            total += term
        if not abs(total) < runaway:
            out[k:] = runaway
            return
        out[k] = total
