"""Recurrent network: an echo-state network with leaky neurons of many time constants.

    x[k+1] = (1 - r) x[k] + r tanh(W x[k] + V u[k] + z),    y = Q (x, u, 1)

W, V and z are drawn from a fixed seed and only Q is fitted, by ridge regression.  The inputs alone
drive it, so its free run is what it was trained for.  (Jaeger 2001, GMD report 148; Jaeger et al.
2007, doi:10.1016/j.neunet.2007.04.016.)
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept
from motor_sysid.structures.base import Kind, Numbers, Run

Array = NDArray[np.float64]

_NEURONS = 25
_RADIUS = 0.9
_RIDGE = 1e-5


class EchoState(Kind):
    """Neurons: 25 times the order."""

    key = 'echo_state'
    title = 'recurrent network (echo state)'
    source = 'Jaeger, GMD report 148, 2001'
    limits = 'weights of the reservoir are random; knows nothing outside of its data'
    orders = (1, 2, 4)
    strides = (1, 3, 10)
    joint = True

    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Fit the output weights; see `Kind.fit`."""
        longest = 0.1 * max(len(run) for run in runs)
        rng = np.random.default_rng(0)
        n, inputs = _NEURONS * order, runs[0].u.shape[1]
        links = rng.standard_normal((n, n)) * (rng.random((n, n)) < min(1.0, 6.0 / n))
        radius = float(np.max(np.abs(np.linalg.eigvals(links))))
        numbers = {
            'links': links * (_RADIUS / max(radius, 1e-12)),
            'entry': rng.uniform(-1, 1, (n, inputs)),
            'offset': 0.3 * rng.uniform(-1, 1, n),
            'rate': 1 / np.geomspace(1.0, max(longest, 2.0), n),
        }
        x = np.concatenate([_states(numbers, run.u) for run in runs])
        y = np.concatenate([run.y for run in runs])
        gram = x.T @ x
        gram += _RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram))
        return {**numbers, 'out': np.linalg.solve(gram, x.T @ y)}

    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Run freely from rest; see `Kind.simulate`."""
        return np.asarray(_states(numbers, u) @ numbers['out'])


def _states(numbers: Numbers, u: Array) -> Array:
    """Return (N, n + m + 1) states, the inputs before, and ones."""
    x = _loop(
        numbers['links'], numbers['entry'], numbers['offset'], numbers['rate'],
        np.ascontiguousarray(u),
    )  # fmt: skip
    before = np.vstack([np.zeros((1, u.shape[1])), u[:-1]])
    return np.column_stack([x, before, np.ones(len(u))])


@kept(nogil=True)
def _loop(links, entry, offset, rate, u):  # type: ignore[no-untyped-def]
    count, n = len(u), len(offset)
    out = np.zeros((count, n))
    for k in range(count - 1):
        inside = links @ out[k] + entry @ u[k] + offset
        for i in range(n):
            out[k + 1, i] = out[k, i] + rate[i] * (np.tanh(inside[i]) - out[k, i])
    return out
