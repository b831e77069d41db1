"""Linear difference equations with a noise model, fitted by their prediction error.

    A(q) (y - c) = B(q) / F(q) u + C(q) / D(q) e,    A = 1 + a1 q^-1 + ...

Gauss-Newton with the exact gradient, which is again a handful of filters; zeros of C and F that
leave the unit circle are reflected.  The free motion of F at the start of each run is taken out by
projection.  (Ljung 1999, sections 4.2 and 7.2, 10.3 for the gradient; Box and Jenkins 1970.)
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from motor_sysid.structures.base import Numbers, Run, START_ROWS

Array = NDArray[np.float64]

_STEPS, _ENOUGH = 40, 1e-8
_LENGTHS = (1.0, 0.5, 0.25, 0.1, 0.02)
_NEAR_ONE = 0.99999
_MOST_DELAY, _SCAN_ORDER, _WORTH = 15, 2, 4.0


@dataclass(frozen=True)
class Polynomials:
    """The polynomials of a difference equation, each without its leading 1.

    Attributes
    ----------
    a, f, c, d:
        (n,) coefficients of A, F, C and D.
    b:
        (m, n) coefficients of B for each input, the first one at ``q^-delay``.
    level:
        The constant c.
    delay:
        Samples from an input to its effect, at least 1.
    """

    a: Array
    b: Array
    f: Array
    c: Array
    d: Array
    level: float
    delay: int

    def vector(self) -> Array:
        """Return all coefficients in one vector."""
        return np.concatenate(
            [self.a, self.b.ravel(), self.f, self.c, self.d, [self.level]]
        )

    def with_vector(self, z: Array) -> 'Polynomials':
        """Return the polynomials of other coefficients, C and F made stable."""
        edges = np.cumsum([self.a.size, self.b.size, self.f.size, self.c.size, self.d.size])
        a, b, f, c, d, level = np.split(z, edges)
        return replace(
            self, a=a, b=b.reshape(self.b.shape), f=reflected(f), c=reflected(c), d=d,
            level=float(level[0]),
        )  # fmt: skip

    def numbers(self) -> Numbers:
        """Return the coefficients by name."""
        return {
            'a': self.a, 'b': self.b, 'f': self.f, 'c': self.c, 'd': self.d,
            'level': np.array([self.level]), 'delay': np.array([float(self.delay)]),
        }  # fmt: skip

    @classmethod
    def of(cls, numbers: Numbers) -> 'Polynomials':
        """Return what `numbers` gave."""
        parts = {name: numbers[name] for name in 'abfcd'}
        return cls(**parts, level=float(numbers['level'][0]), delay=int(numbers['delay'][0]))

    @property
    def dynamics(self) -> Array:
        """Coefficients of A F, with the leading 1: the poles from input to output."""
        return np.convolve(_monic(self.a), _monic(self.f))


def _monic(tail: Array) -> Array:
    return np.concatenate(([1.0], tail))


def reflected(tail: Array) -> Array:
    """Return coefficients whose zeros outside the unit circle are mirrored into it."""
    if tail.size == 0 or not np.all(np.isfinite(tail)):
        return tail
    roots = np.roots(_monic(tail))
    size = np.abs(roots)
    if np.all(size < _NEAR_ONE):
        return tail
    inside = np.where(size > 1, roots / np.maximum(size, 1e-300) ** 2, roots)
    inside = np.where(np.abs(inside) > _NEAR_ONE, _NEAR_ONE * inside / np.abs(inside), inside)
    return np.real(np.poly(inside))[1:]


def _late(values: Array, lag: int) -> Array:
    """Return (N,) values `lag` rows later, zero before."""
    moved = np.zeros_like(values)
    moved[lag:] = values[: values.size - lag] if lag else values
    return moved


def pushed(p: Polynomials, u: Array) -> Array:
    """Return (N,) ``B / F u`` from rest."""
    taps = [np.concatenate((np.zeros(p.delay), row)) for row in p.b]
    total = np.zeros(len(u))
    for row, column in zip(taps, u.T, strict=True):
        total += lfilter(row, [1.0], column)
    return np.asarray(lfilter([1.0], _monic(p.f), total), dtype=np.float64)


def errors(p: Polynomials, run: Run) -> tuple[Array, Array, Array]:
    """Return (N,) pushed output, equation error and prediction error of one run."""
    w = pushed(p, run.u)
    v = lfilter(_monic(p.a), [1.0], run.y[:, 0] - p.level) - w
    return w, v, np.asarray(lfilter(_monic(p.d), _monic(p.c), v))


def gradient(p: Polynomials, run: Run) -> tuple[Array, Array]:
    """Return (N,) prediction errors and their (N, k) derivative, free motion taken out."""
    w, v, e = errors(p, run)
    d, c, f = _monic(p.d), _monic(p.c), _monic(p.f)
    seen = lfilter(d, c, run.y[:, 0] - p.level)
    moved = lfilter(d, np.convolve(c, f), w)
    columns = [_late(seen, i + 1) for i in range(p.a.size)]
    for column in run.u.T:
        passed = lfilter(d, np.convolve(c, f), column)
        columns += [-_late(passed, p.delay + i) for i in range(p.b.shape[1])]
    columns += [_late(moved, i + 1) for i in range(p.f.size)]
    columns += [-_late(lfilter([1.0], c, e), i + 1) for i in range(p.c.size)]
    columns += [_late(lfilter([1.0], c, v), i + 1) for i in range(p.d.size)]
    columns.append(np.full(w.size, -float(d.sum() / c.sum() * _monic(p.a).sum())))
    lost = max(p.a.size, 1)
    both = np.column_stack([*columns, e])[lost:]
    if p.f.size:
        impulse = np.zeros(w.size)
        impulse[lost] = 1.0
        motion = lfilter(d, np.convolve(c, f), impulse)
        basis = np.column_stack([_late(motion, i) for i in range(p.f.size)])[lost:]
        q, _ = np.linalg.qr(basis)
        both = both - q @ (q.T @ both)
    return both[:, -1], both[:, :-1]


def minimized(p: Polynomials, runs: Sequence[Run]) -> Polynomials:
    """Return the polynomials at the nearest minimum of the squared prediction error."""
    cost, slope, curvature = _equations(p, runs)
    for _ in range(_STEPS):
        scale = np.sqrt(np.maximum(np.diag(curvature), 1e-300))
        step = np.linalg.lstsq(curvature / np.outer(scale, scale), slope / scale, rcond=1e-11)[0]
        z, moved = p.vector(), False
        for length in _LENGTHS:
            ahead = p.with_vector(z - length * step / scale)
            fresh = _equations(ahead, runs)
            if fresh[0] < cost:
                gain, moved = (cost - fresh[0]) / cost, True
                p, (cost, slope, curvature) = ahead, fresh
                break
        if not moved or gain < _ENOUGH:
            break
    return p


def _equations(p: Polynomials, runs: Sequence[Run]) -> tuple[float, Array, Array]:
    """Return sum of squares, half its gradient (k,) and curvature (k, k)."""
    size = p.vector().size
    cost, slope, curvature = 0.0, np.zeros(size), np.zeros((size, size))
    for run in runs:
        with np.errstate(over='ignore', invalid='ignore'):
            e, j = gradient(p, run)
            cost += float(e @ e)
        if not np.isfinite(cost):
            return np.inf, np.zeros(size), np.eye(size)
        slope, curvature = slope + j.T @ e, curvature + j.T @ j
    return cost, slope, curvature


def least_squares(runs: Sequence[Run], order: int, delay: int) -> Polynomials:
    """Return the equation ``A (y - c) = B u + e`` by linear least squares."""
    x, y = [], []
    inputs = runs[0].u.shape[1]
    for run in runs:
        lost = max(order, delay + order - 1)
        columns = [-_late(run.y[:, 0], i + 1) for i in range(order)]
        columns += [_late(column, delay + i) for column in run.u.T for i in range(order)]
        x.append(np.column_stack([*columns, np.ones(len(run))])[lost:])
        y.append(run.y[lost:, 0])
    found = np.linalg.lstsq(np.concatenate(x), np.concatenate(y), rcond=1e-12)[0]
    a, b, level = found[:order], found[order:-1].reshape(inputs, order), float(found[-1])
    none = np.zeros(0)
    steady = 1 + float(a.sum())
    return Polynomials(a, b, none, none, none, level / steady if steady else 0.0, delay)


def best_delay(runs: Sequence[Run]) -> int:
    """Return the delay of the best equation of order 2, the shortest of about equal ones."""
    costs = []
    for delay in range(1, _MOST_DELAY + 1):
        p = least_squares(runs, _SCAN_ORDER, delay)
        left = [errors(p, run)[2][_MOST_DELAY + _SCAN_ORDER :] for run in runs]
        costs.append(float(np.mean(np.concatenate(left) ** 2)))
    enough = (1 + _WORTH / sum(map(len, runs))) * min(costs)
    return 1 + next(k for k, cost in enumerate(costs) if cost <= enough)


def steiglitz_mcbride(runs: Sequence[Run], order: int, delay: int) -> Polynomials:
    """Return ``y = B / F u`` by least squares between signals filtered by the last ``1 / F``.

    The iterate with the smallest output error is kept.  (Steiglitz and McBride 1965,
    doi:10.1109/TAC.1965.1098181.)
    """
    arx = least_squares(runs, order, delay)
    best, lowest, f = arx, np.inf, reflected(arx.a)
    for _ in range(12):
        passed = [
            Run(lfilter([1.0], _monic(f), r.u, axis=0), lfilter([1.0], _monic(f), r.y, axis=0))
            for r in runs
        ]
        now = least_squares(passed, order, delay)
        f = reflected(now.a)
        p = replace(now, a=np.zeros(0), f=f, level=0.0)
        cost = _equations(p, runs)[0]
        if cost < lowest:
            best, lowest = p, cost
    return best


def whitening(left: Sequence[Array], order: int) -> Array:
    """Return the (order,) coefficients of D that whitens errors, by Yule-Walker."""
    covariance = np.zeros(order + 1)
    for e in left:
        covariance += [float(e[: e.size - k] @ e[k:]) for k in range(order + 1)]
    covariance[0] *= 1 + 1e-9
    return np.asarray(-solve_toeplitz(covariance[:-1], covariance[1:]))


def free_run(numbers: Numbers, u: Array, start: Array) -> Array:
    """Return the (N, 1) free run of ``B / (A F)``, begun as the first measured rows ask for."""
    p = Polynomials.of(numbers)
    whole = p.dynamics
    forced = p.level + np.asarray(lfilter([1.0], _monic(p.a), pushed(p, u)))
    if len(start) == 0 or whole.size == 1:
        return forced[:, np.newaxis]
    impulse = np.zeros(len(u))
    impulse[0] = 1.0
    motion = lfilter([1.0], whole, impulse)
    basis = np.column_stack([_late(motion, i) for i in range(whole.size - 1)])
    rows = min(len(start), len(u))
    change = np.linalg.lstsq(basis[:rows], start[:rows, 0] - forced[:rows], rcond=1e-6)[0]
    return np.asarray((forced + basis @ change)[:, np.newaxis])


def one_ahead(numbers: Numbers, run: Run) -> Array:
    """Return the (N, 1) outputs one row ahead; the free run in the first rows."""
    e = errors(Polynomials.of(numbers), run)[2]
    ahead = run.y - e[:, np.newaxis]
    ahead[:START_ROWS] = free_run(numbers, run.u, run.y[:START_ROWS])[:START_ROWS]
    return ahead
