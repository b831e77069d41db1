"""Compare a model with records: errors by channel, and where the model fails."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.residual import curve, lacking_name, measured_states, unexplained
from motor_sysid.diagnosis.result import Curve, Map, Where
from motor_sysid.estimation.batch import Chain, Problem
from motor_sysid.physics.model import linear_unit, Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

BINS = 24


@dataclass(frozen=True)
class Comparison:
    """Measured against simulated, free-running from the recorded input.

    Attributes
    ----------
    error_percent:
        RMS over channels of the channel errors.
    channel_percent:
        Output to RMS error in percent of the RMS of the measured signal.
    predictions:
        For each scored stretch, output to (N,) simulated values.
    residuals:
        For each scored stretch (N, n_y) measured minus simulated.
    measured:
        For each scored stretch (N, n_y).
    """

    error_percent: float
    channel_percent: Mapping[str, float]
    predictions: tuple[Mapping[str, Array], ...]
    residuals: tuple[Array, ...]
    measured: tuple[Array, ...]


def compare(
    model: Model, chains: Sequence[Chain], outputs: Sequence[str], *, substeps: int = 1
) -> Comparison:
    """Run a model over chains from the measured initial state and take the errors."""
    problem = Problem(model, chains, outputs, substeps=substeps)
    near = problem.linearize(problem.vector(), parameters=False)
    residuals = tuple(one.residual for one in near)
    measured = tuple(stretch.judged for stretch in problem.stretches)
    channel = channel_errors(residuals, measured)
    predictions = tuple(
        {name: (m - r)[:, j] for j, name in enumerate(outputs)}
        for m, r in zip(measured, residuals, strict=True)
    )
    return Comparison(
        float(np.sqrt(np.mean(channel**2))),
        dict(zip(outputs, channel.tolist(), strict=True)),
        predictions,
        residuals,
        measured,
    )


def channel_errors(residuals: Sequence[Array], measured: Sequence[Array]) -> Array:
    """Return (n_y,) RMS errors in percent of the RMS of the measured signals."""
    error = np.sqrt(np.mean(np.concatenate(residuals) ** 2, axis=0))
    size = np.sqrt(np.mean(np.concatenate(measured) ** 2, axis=0))
    percent: Array = 100 * error / np.maximum(size, 1e-300)
    return percent


@dataclass(frozen=True)
class Failure:
    """Where a model fails: errors by axis, unexplained force by axis, and both over two axes."""

    where: tuple[Where, ...]
    curves: tuple[Curve, ...]
    maps: tuple[Map, ...]


def failure_of(
    model: Model,
    records: Sequence[Record],
    roles: Sequence[str],
    predictions: Sequence[Mapping[str, Array]],
) -> Failure:
    """Say where a model fails.

    Parameters
    ----------
    model:
        The model.
    records, roles:
        Uniform records, each ``train`` or ``validate``.
    predictions:
        For each record, output to the (N,) values that the model gives.
    """
    held = [k for k, role in enumerate(roles) if role == 'validate'] or list(range(len(records)))
    outputs = list(predictions[0])
    measured = [np.stack([records[k][n] for n in outputs], axis=1) for k in held]
    residuals = [
        m - np.stack([predictions[k][n] for n in outputs], axis=1)
        for k, m in zip(held, measured, strict=True)
    ]
    where = _where(model, [records[k] for k in held], residuals, measured)
    return Failure(where, failure_curves(model, records), ())


def where_it_fails(
    model: Model, records: Sequence[Record], comparison: Comparison
) -> tuple[Where, ...]:
    """Say along which axes the (combined, relative) squared error is concentrated."""
    return _where(model, records, comparison.residuals, comparison.measured)


def _where(
    model: Model,
    records: Sequence[Record],
    residuals: Sequence[Array],
    measured: Sequence[Array],
) -> tuple[Where, ...]:
    size = np.sqrt(np.mean(np.concatenate(measured) ** 2, axis=0))
    parts = [np.mean((r / size) ** 2, axis=1) for r in residuals]
    squared = np.concatenate(parts)
    found = []
    for axis, (unit, x, edges) in _axes(model, records).items():
        place = np.clip(np.digitize(x, edges) - 1, 0, edges.size - 2)
        count = np.bincount(place, minlength=edges.size - 1)
        total = np.bincount(place, weights=squared, minlength=edges.size - 1)
        with np.errstate(invalid='ignore', divide='ignore'):
            percent = 100 * np.sqrt(np.where(count >= 8, total / count, np.nan))
        share = total / max(float(np.sum(squared)), 1e-300)
        found.append(Where(axis, unit, edges, percent, share, count / x.size))
    return tuple(found)


def failure_curves(model: Model, records: Sequence[Record]) -> tuple[Curve, ...]:
    """Return the unexplained torque and voltage against speed, position, current and time."""
    axes = _axes(model, records)
    units = {force.name: force.unit for force in model.kind.forces}
    lacking = [unexplained(model, record) for record in records]
    curves = []
    for name in units:
        parts = [one[name] for one in lacking if name in one]
        if len(parts) != len(records):
            continue
        y = np.concatenate(parts)
        unit = linear_unit(units[name]) if model.linear else units[name]
        for axis, (axis_unit, x, edges) in axes.items():
            if axis in ('speed', 'position', 'current', 'time') and x.size == y.size:
                drawn = curve(axis, axis_unit, lacking_name(model, name), unit, x, y, edges)
                if drawn is not None:
                    curves.append(drawn)
    return tuple(curves)


def _axes(model: Model, records: Sequence[Record]) -> dict[str, tuple[str, Array, Array]]:
    """Return axis to (unit, values over all records, bin edges)."""
    evens = [record.uniform() for record in records]
    states = [measured_states(model, even) for even in evens]
    speed = np.concatenate([s['omega'] for s in states])
    top = float(np.quantile(np.abs(speed), 0.995)) or 1.0
    length = 'm' if model.linear else 'rad'
    axes = {
        'speed': (f'{length}/s', speed, np.linspace(-top, top, BINS + 1)),
        'direction': ('1', np.sign(np.where(np.abs(speed) < 0.01 * top, 0, speed)),
                      np.array([-1.5, -0.5, 0.5, 1.5])),
    }  # fmt: skip
    if all('theta' in s for s in states):
        angle = np.concatenate([s['theta'] for s in states])
        if not model.linear:
            angle = np.mod(angle, 2 * np.pi)
        low, high = (angle.min(), angle.max()) if model.linear else (0.0, 2 * np.pi)
        axes['position'] = (length, angle, np.linspace(low, high + 1e-9, 4 * BINS + 1))
    if all('i' in s for s in states):
        current = np.concatenate([s['i'] for s in states])
        reach = float(np.quantile(np.abs(current), 0.995)) or 1.0
        axes['current'] = ('A', current, np.linspace(-reach, reach, BINS + 1))
    ends = np.cumsum([0.0] + [even.duration for even in evens])
    clock = np.concatenate(
        [even.time - even.time[0] + end for even, end in zip(evens, ends[:-1], strict=True)]
    )
    axes['time'] = ('s', clock, np.linspace(0, float(ends[-1]) + 1e-9, BINS + 1))
    if all('temperature' in even for even in evens):
        heat = np.concatenate([even['temperature'] for even in evens])
        axes['temperature'] = ('degC', heat, np.linspace(heat.min(), heat.max() + 1e-9, 9))
    return axes
