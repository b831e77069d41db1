"""Steiglitz and McBride's iteration on the sampled motor: linear rows whose error is the output's.

With the motor ``x[t+1] = F x[t] + G u[t]`` and the last estimate ``F'``, the measured states obey

    x = H (F - F') x + H G u + H' x0 + offset + noise,    H = (q - F')^-1,

linear in ``F - F'`` and G, and with ``F = F'`` the error is what the sensors add, no longer that
of an equation.  Rows of all samples are condensed to a small triangle; on it the physical
parameters, of which F and G are functions, are found, and the filter is renewed.  Unlike the
output error it never runs the model freely over the record, so that it needs no start value.
(Steiglitz and McBride 1965, doi:10.1109/TAC.1965.1098181; consistent for white noise only: Stoica
and Soderstrom 1981, doi:10.1109/TAC.1981.1102681.)
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.methods.rows import result_of, sandwich
from motor_sysid.estimation.batch.methods.sampled import Core, one_rate, response
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult

Array = NDArray[np.float64]

KEY = 'steiglitz_mcbride'

_ROUNDS, _SETTLED = 30, 1e-5
_STEP = 1e-6


class _Data(NamedTuple):
    """What is fitted.

    Attributes
    ----------
    problem, core, dt:
        Problem, the core of its motor, sample time in s.
    runs:
        (N, n) states as measured without held offsets, and (N, n_u) inputs of each record.
    biases:
        Place of each free offset among the states, and its name.
    """

    problem: Problem
    core: Core
    dt: float
    runs: Sequence[tuple[Array, Array]]
    biases: tuple[tuple[int, str], ...]


def fit(problem: Problem) -> FitResult:
    """Fit a linear motor whose states are measured.

    Raises
    ------
    UserError
        If the model has effects or its motor is not linear, or a state is not measured.
    """
    data = _data(problem)
    z = problem.vector()
    sigma = np.std(np.concatenate([x for x, _ in data.runs]), axis=0)
    for rounds in range(1, _ROUNDS + 1):  # noqa: B007
        rows = _rows(data, z, sigma)
        moved = _solved(data, z, rows)
        near = float(np.max(np.abs(moved - z))) < _SETTLED
        error = rows @ _coefficients(data, moved, z)
        sigma = sigma * np.sqrt(np.mean(error.reshape(-1, sigma.size) ** 2, axis=0))
        z = moved
        if near:
            break
    spread = np.sqrt(np.diag(_covariance(data, z, _rows(data, z, sigma))))
    names = [p.name for p in problem.free]
    sigmas = dict(zip(names, (spread * problem.slope(z)).tolist(), strict=True))
    result = result_of(problem, problem.model_at(z), sigmas)
    return replace(
        result, success=result.success and near, iterations=rounds,
        reason=f'{"settled" if near else "did not settle"} within {rounds} rounds',
    )  # fmt: skip


def _data(problem: Problem) -> _Data:
    model, records = problem.model, [s.record for s in problem.stretches]
    if model.effects:
        raise UserError(
            f'`{KEY}` fits a linear motor; leave out {", ".join(model.effects)} or use another '
            'method'
        )
    core = Core.of(model, KEY)
    biases = {o.state: o.bias for o in model.kind.outputs if o.bias}
    here = [(k, biases[name]) for k, name in enumerate(core.states) if name in biases]
    runs = []
    for record in records:
        x, u = core.measured(record)
        for k, bias in here:
            x[:, k] -= 0.0 if model.parameters[bias].free else model[bias]
        runs.append((x, u))
    free = tuple(one for one in here if model.parameters[one[1]].free)
    return _Data(problem, core, one_rate(records, KEY), runs, free)


def _values(data: _Data, z: Array) -> dict[str, float]:
    return {name: float(v[0]) for name, v in data.problem.values(z[np.newaxis]).items()}


def _rows(data: _Data, z: Array, sigma: Array) -> Array:
    """Return the (K, C) weighed columns that belong to `_coefficients`, filtered by the motor z.

    What an initial state explains of a record is taken out of all columns.
    """
    phi, parts = data.core.step(_values(data, z), data.dt)[0], []
    for x, u in data.runs:
        signals = np.column_stack([x, u])
        count, n = x.shape
        width = signals.shape[1]
        drive, start = np.zeros((count, n, n * width)), np.zeros((count, n, n))
        for a in range(n):
            drive[:, a, a * width : (a + 1) * width] = signals
        start[0] = phi
        begins = response(phi, start)
        begins[0] = np.eye(n)
        offsets = np.zeros((count, n, len(data.biases)))
        for k, (a, _) in enumerate(data.biases):
            offsets[:, a, k] = 1.0
        columns = np.concatenate([response(phi, drive), offsets, x[:, :, np.newaxis]], axis=2)
        q, _ = np.linalg.qr((begins / sigma[:, np.newaxis]).reshape(-1, n))
        flat = (columns / sigma[:, np.newaxis]).reshape(-1, columns.shape[2])
        parts.append(flat - q @ (q.T @ flat))
    return np.concatenate(parts)


def _coefficients(data: _Data, z: Array, last: Array) -> Array:
    """Return (C,) what the columns are multiplied with: ``-[F - F', G]``, offsets, and 1."""
    values = _values(data, z)
    phi, gamma = data.core.step(values, data.dt)
    before = data.core.step(_values(data, last), data.dt)[0]
    offsets = [values[name] for _, name in data.biases]
    return np.concatenate([-np.column_stack([phi - before, gamma]).ravel(),
                           -np.array(offsets), [1.0]])  # fmt: skip


def _solved(data: _Data, last: Array, rows: Array) -> Array:
    """Return the (d,) parameters that leave least of the rows."""
    triangle = np.linalg.qr(rows, mode='r')
    lower, upper = data.problem.box()

    def off(z: Array) -> Array:
        return np.asarray(triangle @ _coefficients(data, z, last))

    found = least_squares(
        off, np.clip(last, lower, upper), bounds=(lower, upper), x_scale='jac', xtol=1e-12,
        ftol=1e-12,
    )  # fmt: skip
    return np.asarray(found.x)


def _covariance(data: _Data, z: Array, rows: Array) -> Array:
    """Return the (d, d) sandwich of the solution, see `sandwich`."""
    steps = _STEP * np.eye(z.size)
    slopes = [_coefficients(data, z + s, z) - _coefficients(data, z - s, z) for s in steps]
    jacobian = rows @ (np.array(slopes).T / (2 * _STEP))
    error = rows @ _coefficients(data, z, z)
    bread = np.asarray(np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-12), dtype=np.float64)
    return sandwich(bread, jacobian * error[:, np.newaxis])
