"""State space by subspaces: past-output MOESP.

Block rows of future inputs, past inputs and outputs and future outputs are made triangular; the
column space of what the past tells of future outputs is that of the observability matrix. C is its
first block, A follows from its shift; B, D = 0, constant and initial state are then linear in the
outputs and fitted to the whole free run. (Verhaegen 1994, doi:10.1016/0005-1098(94)90229-1; Van
Overschee and De Moor, Subspace Identification for Linear Systems, 1996.)
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept
from motor_sysid.structures.base import Kind, Numbers, Run

Array = NDArray[np.float64]

_MARGIN = 8
_NEAR_ONE = 0.99999


class StateSpace(Kind):
    """All outputs from one state."""

    key = 'ss'
    title = 'state space (subspace)'
    source = 'Verhaegen, Automatica 1994; Van Overschee and De Moor 1996'
    limits = 'linear; poles are not refined by the output error'
    orders = (1, 2, 3, 4, 6)
    strides = (1, 3, 10)
    joint = True

    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Fit; see `Kind.fit`."""
        a, c = dynamics(runs, order)
        b, level = inputs(runs, a, c)
        return {'a': a, 'b': b, 'c': c, 'level': level}

    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Run freely; see `Kind.simulate`."""
        a, b, c = numbers['a'], numbers['b'], numbers['c']
        forced = _driven(a, np.ascontiguousarray(u @ b.T), np.zeros(len(a))) @ c.T
        forced = forced + numbers['level']
        rows = min(len(start), len(u))
        if rows == 0:
            return np.asarray(forced)
        motion = _motion(a, c, len(u))
        first = motion[:rows].reshape(-1, len(a))
        left = (start[:rows] - forced[:rows]).ravel()
        return np.asarray(forced + motion @ np.linalg.lstsq(first, left, rcond=1e-6)[0])


def dynamics(runs: Sequence[Run], order: int) -> tuple[Array, Array]:
    """Return A (n, n), made stable, and C (p, n)."""
    outputs = runs[0].y.shape[1]
    depth = order + _MARGIN
    future_u, past, future_y = (
        np.concatenate(parts) for parts in zip(*(_hankel(r, depth) for r in runs), strict=True)
    )
    whole = np.column_stack([future_u, past, future_y])
    triangle = np.asarray(np.linalg.qr(whole, mode='r')).T
    first = future_u.shape[1]
    second = first + past.shape[1]
    observable, _, _ = np.linalg.svd(triangle[second:, first:second], full_matrices=False)
    gamma = observable[:, :order]
    a = np.linalg.lstsq(gamma[:-outputs], gamma[outputs:], rcond=None)[0]
    return stable(a), gamma[:outputs]


def _hankel(run: Run, depth: int) -> tuple[Array, Array, Array]:
    """Return future inputs, past inputs and outputs, and future outputs, one row a sample."""
    count = len(run) - 2 * depth + 1

    def block(values: Array, first: int) -> Array:
        return np.column_stack([values[first + k : first + k + count] for k in range(depth)])

    past = np.column_stack([block(run.u, 0), block(run.y, 0)])
    future_u = np.column_stack([block(run.u, depth), np.ones(count)])  # the constant is an input
    return future_u, past, block(run.y, depth)


def stable(a: Array) -> Array:
    """Return A with eigenvalues outside the unit circle drawn to it."""
    values, vectors = np.linalg.eig(a)
    size = np.abs(values)
    if np.all(size < _NEAR_ONE):
        return a
    inside = values * np.minimum(1.0, _NEAR_ONE / np.maximum(size, 1e-300))
    return np.real(vectors @ np.diag(inside) @ np.linalg.inv(vectors))


def inputs(runs: Sequence[Run], a: Array, c: Array) -> tuple[Array, Array]:
    """Return B (n, m) and the constant (p,) that fit the free runs best."""
    n, m, p = len(a), runs[0].u.shape[1], len(c)
    x, y = [], []
    for run in runs:
        columns = []
        for column in run.u.T:
            for k in range(n):
                push = np.zeros((len(run), n))
                push[:, k] = column
                columns.append(_driven(a, push, np.zeros(n)) @ c.T)
        ones = [np.tile(np.eye(p)[j], (len(run), 1)) for j in range(p)]
        motion = _motion(a, c, len(run)).reshape(-1, n)
        both = np.column_stack([part.ravel() for part in (*columns, *ones, run.y)])
        q, _ = np.linalg.qr(motion)
        both -= q @ (q.T @ both)
        x.append(both[:, :-1])
        y.append(both[:, -1])
    found = np.linalg.lstsq(np.concatenate(x), np.concatenate(y), rcond=1e-10)[0]
    return found[: n * m].reshape(m, n).T, found[n * m :]


def _motion(a: Array, c: Array, count: int) -> Array:
    """Return (N, p, n) outputs from every unit initial state."""
    n = len(a)
    nothing = np.zeros((count, n))
    parts = [_driven(a, nothing, start) @ c.T for start in np.eye(n)]
    return np.stack(parts, axis=2)


@kept(nogil=True)
def _driven(a, push, x):  # type: ignore[no-untyped-def]
    """Return (N, n) states of ``x+ = A x + push``."""
    count, n = push.shape
    out = np.empty((count, n))
    now = x.copy()
    new = np.empty(n)
    for k in range(count):
        for i in range(n):
            out[k, i] = now[i]
            total = push[k, i]
            for j in range(n):
                total += a[i, j] * now[j]
            new[i] = total
        now[:] = new
    return out
