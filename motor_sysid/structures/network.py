"""Feed-forward network: one hidden layer on delayed outputs and inputs, run freely.

    y[k] = y[k-1] + w0 + w' x + v' tanh(W x + z),    x = (y[k-1 ...], u[k-1 ...])

A straight part beside the hidden layer, one-step training by Levenberg-Marquardt with the exact
Jacobian, weights drawn from a fixed seed.  (Narendra and Parthasarathy 1990, doi:10.1109/72.80202;
Hagan and Menhaj 1994, doi:10.1109/72.329697.)
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from motor_sysid.machine_code import kept
from motor_sysid.structures.base import Kind, Numbers, Run

Array = NDArray[np.float64]

_LAGS = 2
_RIDGE = 1e-3
_MOST = 25
_RUNAWAY = 1e3


class Network(Kind):
    """Hidden neurons: four times the order."""

    key = 'network'
    title = 'feed-forward network'
    source = 'Narendra and Parthasarathy, IEEE Trans. Neural Networks 1990'
    limits = 'trained one step ahead; knows nothing outside of its data'
    orders = (1, 2)
    strides = (1, 5, 20)

    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Train; see `Kind.fit`."""
        rows = np.concatenate([_inputs(run) for run in runs])
        wanted = np.concatenate([np.diff(run.y[_LAGS - 1 :, 0]) for run in runs])
        size = max(float(np.std(wanted)), 1e-12)
        rng = np.random.default_rng(0)
        hidden, width = 4 * order, rows.shape[1]
        start = np.concatenate(
            [0.7 * rng.standard_normal(hidden * (width + 1)), np.zeros(hidden + width + 1)]
        )
        keep = _RIDGE * np.sqrt(len(wanted))

        def residual(z: Array) -> Array:
            layer, linear = _split(z, hidden, width)
            return np.concatenate([_layers(layer, linear, rows)[0] - wanted / size, keep * z])

        def jacobian(z: Array) -> Array:
            layer, linear = _split(z, hidden, width)
            return np.vstack([_layers(layer, linear, rows)[1], keep * np.eye(z.size)])

        found = least_squares(residual, start, jac=jacobian, method='lm', max_nfev=_MOST)
        layer, linear = _split(np.asarray(found.x), hidden, width)
        return {'layer': layer, 'linear': linear, 'size': np.array([size])}

    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Run freely; see `Kind.simulate`."""
        out = np.zeros(len(u))
        first = start[:_LAGS, 0]
        out[: first.size] = first[: len(u)]
        _loop(
            numbers['layer'], numbers['linear'], float(numbers['size'][0]),
            np.ascontiguousarray(u), _RUNAWAY, out,
        )  # fmt: skip
        return out[:, np.newaxis]

    def predict(self, numbers: Numbers, run: Run, dt: float) -> Array:
        """Predict; see `Kind.predict`."""
        ahead = run.y.copy()
        step = _layers(numbers['layer'], numbers['linear'], _inputs(run))[0]
        ahead[_LAGS:, 0] = run.y[_LAGS - 1 : -1, 0] + float(numbers['size'][0]) * step
        return ahead


def _inputs(run: Run) -> Array:
    """Return (N - lags, V) delayed outputs and inputs."""
    both = np.column_stack([run.y[:, :1], run.u])
    return np.column_stack([both[_LAGS - k : len(both) - k] for k in range(1, _LAGS + 1)])


def _split(z: Array, hidden: int, width: int) -> tuple[Array, Array]:
    """Return the hidden layer (h, V + 2), its last column the output weights, and (V + 1,)."""
    inner, outer, linear = np.split(z, [hidden * (width + 1), hidden * (width + 2)])
    return np.column_stack([inner.reshape(hidden, width + 1), outer]), linear


def _layers(layer: Array, linear: Array, rows: Array) -> tuple[Array, Array]:
    """Return the (K,) output of the network and its (K, d) derivative by the weights."""
    weights, outer = layer[:, :-1], layer[:, -1]
    wide = np.column_stack([rows, np.ones(len(rows))])
    active = np.tanh(wide @ weights.T)
    value = active @ outer + wide @ linear
    slope = (1 - active**2) * outer
    inner = (slope[:, :, np.newaxis] * wide[:, np.newaxis, :]).reshape(len(rows), -1)
    return value, np.column_stack([inner, active, wide])


@kept(nogil=True)
def _loop(layer, linear, size, u, runaway, out):  # type: ignore[no-untyped-def]
    inputs = u.shape[1]
    width = linear.size
    row = np.ones(width)
    for k in range(2, out.size):
        for lag in range(1, 3):
            at = (lag - 1) * (inputs + 1)
            row[at] = out[k - lag]
            for j in range(inputs):
                row[at + 1 + j] = u[k - lag, j]
        total = 0.0
        for v in range(width):
            total += linear[v] * row[v]
        for h in range(layer.shape[0]):
            inside = 0.0
            for v in range(width):
                inside += layer[h, v] * row[v]
            total += layer[h, width] * np.tanh(inside)
        value = out[k - 1] + size * total
        if not abs(value) < runaway:
            out[k:] = runaway
            return
        out[k] = value
