"""Rows of the balances of a motor: the regressors of the online estimators, kept and not learned.

A batch is a learner that keeps what it is given.  Every balance is one linear equation between
filtered signals, see `motor_sysid.estimation.online.equation`; what the methods of this folder
differ in is how they solve it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from motor_sysid.estimation.batch.least_squares import result_at, Solution
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.estimation.batch.weighting import white
from motor_sysid.estimation.online.despike import Sample
from motor_sysid.estimation.online.equation import Equation, offsets
from motor_sysid.estimation.online.learners.base import Learner
from motor_sysid.estimation.online.reading import sensor_lags
from motor_sysid.estimation.online.regressions import filter_bandwidth, together
from motor_sysid.estimation.online.regressors import Regressors
from motor_sysid.physics.drive import Drive, input_signals
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.base import Balance
from motor_sysid.physics.motors.speed import measured_speed
from motor_sysid.physics.summed import seen_by
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
Values = dict[str, tuple[float, float]]

_SMOOTH = 11
_BLOCKS = 60
_REACH = 1e3


class Rows(Learner):
    """Keeps its rows until `settle`."""

    def __init__(self, start: Array, sigma: Array, keep: float, block: int) -> None:
        super().__init__(start, sigma, keep, block)
        self._x: list[Array] = []
        self._y: list[float] = []
        self._covariance = np.full((start.size, start.size), np.nan)

    def update(self, x: Array, y: float) -> None:
        """Keep a row."""
        self._x.append(x.copy())
        self._y.append(y)

    @property
    def data(self) -> tuple[Array, Array]:
        """The (K, d) regressors and the (K,) values that they explain."""
        return np.array(self._x).reshape(-1, self.coefficients.size), np.array(self._y)

    def settle(self, coefficients: Array, covariance: Array) -> None:
        """Take the solution and its covariance."""
        self.coefficients[:] = coefficients
        self._covariance = covariance

    def covariance(self) -> Array:
        """Return the (d, d) covariance of the solution."""
        return self._covariance


Solver = Callable[[Model, int, Array, Array], tuple[Array, Array]]
"""(model so far, which balance, rows (K, d), values (K,)) to coefficients (d,), covariance."""


def kept(
    model: Model, balance: Balance, offset: Mapping[str, str], records: Sequence[Record],
    outputs: Sequence[str], bandwidth: float,
) -> tuple[Equation, Rows]:  # fmt: skip
    """Return an equation with the rows that records give."""
    dt = records[0].dt
    equation = Equation(model, balance, offset, dt, bandwidth, _REACH, Rows)
    equation.give(model.parameters.values())
    regressors = Regressors(model, outputs)
    regressors.require(equation.needs())
    regressors.set_dynamics(model.kind.matrices(
        {name: np.array([v]) for name, v in model.parameters.values().items()})[0][0])  # fmt: skip
    regressors.set_offsets(model.parameters.values())
    drive = model[balance.drive.parameter] if balance.drive.parameter else 1.0
    prior = {p.name: 1.0 for p in model.parameters}
    for record in records:
        _feed(equation, regressors, record, model, outputs, drive, prior)
    rows = equation.learner(drive, prior)
    assert isinstance(rows, Rows)
    return equation, rows


def _feed(
    equation: Equation, regressors: Regressors, record: Record, model: Model,
    outputs: Sequence[str], drive: float, prior: Mapping[str, float],
) -> None:  # fmt: skip
    dt = record.dt
    u = np.column_stack([record[name] for name in input_signals(record, model.kind)])
    y = np.column_stack([record[name] for name in outputs])
    states = _states(record, model, outputs)
    regressors.restart(y[0])
    for k in range(len(record) - 1):
        sample = Sample(k * dt, dt, u[k], y[k + 1], states[k], states[k + 1])
        regressors.take(sample)
        if k == 0:
            equation.restart(regressors.measured[0], regressors.tracked[0])
        equation.step(regressors.measured, regressors.tracked, dt, drive, prior)


def _states(record: Record, model: Model, outputs: Sequence[str]) -> Array:
    """Return (N, n) states for the laws, which may be steep: smoothed measurements."""
    lags = sensor_lags(model, outputs)
    known = {'omega': measured_speed(record)}
    for output in model.kind.outputs:
        if output.signal in record:
            known.setdefault(output.state, record[output.signal])
    drive = seen_by(model, Drive.of(record, model.kind))
    if drive.position.size:
        known['theta'] = drive.position
    states = np.zeros((len(record), len(model.kind.states)))
    for j, name in enumerate(model.kind.states):
        if name in known:
            states[:, j] = savgol_filter(known[name], _SMOOTH, 2)
            late = lags.get(name, 0.0)
            states[:, j] += late * savgol_filter(known[name], _SMOOTH, 2, 1, record.dt)
    return states


def solved(
    problem: Problem, solver: Solver, *, bandwidth: float | None = None, passes: int = 2
) -> FitResult:
    """Solve every balance in turn and return the model that it gives.

    The first pass filters with the bandwidth of the model as it is, the next one with that of what
    it found.

    Parameters
    ----------
    problem:
        Model and data.
    solver:
        How an equation is solved.
    bandwidth:
        Corner of the filter, rad/s; None takes that of the model.
    passes:
        How often.
    """
    records = [stretch.record for stretch in problem.stretches]
    model, found = problem.model, dict[str, tuple[float, float, float]]()
    for _ in range(passes):
        width = bandwidth or filter_bandwidth(model, records[0].dt)
        found = {}
        chosen = offsets(model, model.kind.balances)
        for k, (balance, offset) in enumerate(zip(model.kind.balances, chosen, strict=True)):
            equation, rows = kept(model, balance, offset, records, problem.outputs, width)
            rows.settle(*solver(model, k, *rows.data))
            drive = _drive(balance, model, found)
            for name, one in equation.found(drive).items():
                found[name] = together(found[name], one) if name in found else one
            model = _moved(model, {name: value for name, (value, *_) in found.items()})
    return result_of(problem, model, {name: sigma for name, (_, sigma, _) in found.items()})


def _drive(
    balance: Balance, model: Model, found: Mapping[str, tuple[float, float, float]]
) -> tuple[float, float]:
    name = balance.drive.parameter
    if not name:
        return 1.0, 0.0
    return (model[name], found[name][1]) if name in found else (model[name], 0.0)


def _moved(model: Model, values: Mapping[str, float]) -> Model:
    """Return the model with values kept inside their boxes."""
    boxes = {p.name: (p.lower, p.upper) for p in model.parameters}
    return model.with_values(
        {name: float(np.clip(v, *boxes[name])) for name, v in values.items() if np.isfinite(v)}
    )


def result_of(problem: Problem, model: Model, sigmas: Mapping[str, float]) -> FitResult:
    """Return a result with the free run of a model, and sigmas of its own."""
    here = Problem(model, problem.chains, problem.outputs, substeps=problem.substeps)
    start = white([s.judged - s.judged.mean(axis=0) for s in here.stretches])
    cost = float(here.costs(here.vector()[np.newaxis], start,
                            here.linearize(here.vector(), parameters=False))[0])  # fmt: skip
    solution = Solution(here.vector(), cost, bool(np.isfinite(cost)), 1, 1)
    result = result_at(here, start, solution, 1, 1)
    spread = np.array([sigmas.get(p.name, np.inf) for p in here.free])
    missing = tuple(
        f'no equation of this method holds {p.name}; it stays at {p.value:.4g} {p.unit}'
        for p in here.free if p.name not in sigmas
    )  # fmt: skip
    names = {p.name: float(s) for p, s in zip(here.free, spread, strict=True)}
    return replace(
        result, model=model.with_estimates({}, names), covariance=np.diag(spread**2),
        unidentifiable=(*result.unidentifiable, *missing), reason='solved without iteration',
    )  # fmt: skip


def least_squares(x: Array, y: Array) -> tuple[Array, Array]:
    """Return the least-squares solution (d,) and its covariance."""
    return instrumental(x, x, y)


def instrumental(z: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """Return the solution of ``Z'(y - X c) = 0`` and its covariance.

    ``B^-1 S B^-T`` with ``B = Z'X`` and S the sum over blocks of time of the outer product of each
    block's ``Z'e``: it holds for errors that are correlated over less than a block.
    (Newey and West 1987, doi:10.2307/1913610.)
    """
    size = np.sqrt(np.maximum(np.mean(x**2, axis=0), 1e-300))
    xs, zs = x / size, z / np.sqrt(np.maximum(np.mean(z**2, axis=0), 1e-300))
    bread = np.linalg.pinv(zs.T @ xs, rcond=1e-12)
    found = bread @ (zs.T @ y)
    scores = zs * (y - xs @ found)[:, np.newaxis]
    return found / size, sandwich(bread, scores) / np.outer(size, size)


def sandwich(bread: Array, scores: Array) -> Array:
    """Return ``bread S bread'`` with S the blockwise variance of the sum of (K, d) scores."""
    pieces = min(_BLOCKS, max(len(scores) // 5, 1))
    sums = np.array([part.sum(axis=0) for part in np.array_split(scores, pieces)])
    sums = sums - sums.mean(axis=0)
    middle = sums.T @ sums * pieces / max(pieces - scores.shape[1], 1)
    whole: Array = bread @ middle @ bread.T
    return whole
