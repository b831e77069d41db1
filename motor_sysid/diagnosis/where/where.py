"""Where a model fails: errors by channel and what each equation lacks, along axes and on maps.

Errors are taken on the held-out records; what the equations lack, on all records.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.curves import ChannelError, Curve, Map, Where
from motor_sysid.diagnosis.where.axes import axes_of, Axis, MAP_COLUMNS, MAP_ROWS
from motor_sysid.diagnosis.where.bands import bin_means
from motor_sysid.diagnosis.where.bands import FEWEST as SAMPLES
from motor_sysid.diagnosis.where.equation_errors import lacking_name
from motor_sysid.diagnosis.where.unexplained import (
    Lack,
    lack_of,
    orthogonal,
    Share,
    share_of,
    smoothed,
)
from motor_sysid.physics.model import linear_unit, Model
from motor_sysid.signals.metrics import moving, sizes_of
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
Predictions = Mapping[str, Array]

LARGEST = 50.0
"""Logarithm beyond which a band has no end; the square of an error is far from normal, so its band
is taken of the logarithm."""

FEWEST = 3
"""Filled bins that a curve needs."""


@dataclass(frozen=True)
class Failure:
    """Where a model fails.

    Attributes
    ----------
    where:
        Errors by axis, on the held-out records.
    curves:
        What each equation lacks by axis, on all records.
    maps:
        Errors and what each equation lacks, over speed and current.
    lacks, share, axes:
        What each equation lacks on each record beyond any base parameters, what those can do, and
        the axes.
    """

    where: tuple[Where, ...]
    curves: tuple[Curve, ...]
    maps: tuple[Map, ...]
    lacks: tuple[Lack, ...]
    share: Share
    axes: Mapping[str, Axis]


def failure_of(
    model: Model,
    records: Sequence[Record],
    roles: Sequence[str],
    predictions: Sequence[Predictions],
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
    raw = [lack_of(model, r, p) for r, p in zip(records, predictions, strict=True)]
    share = share_of(raw)
    lacks = orthogonal(raw, share)
    axes = axes_of(model, records, [one.states for one in lacks])
    held = [k for k, role in enumerate(roles) if role == 'validate'] or list(range(len(records)))
    chosen = [records[k] for k in held]
    errors = [_errors(records[k], predictions[k]) for k in held]
    own = axes_of(model, chosen, [lacks[k].states for k in held])
    return Failure(
        errors_by(own, chosen, errors),
        tuple(curves_by(model, lacks, axes)),
        (*_error_maps(own, chosen, errors), *_force_maps(model, lacks, axes)),
        tuple(lacks),
        share,
        axes,
    )


def errors_by(
    axes: Mapping[str, Axis], records: Sequence[Record], errors: Sequence[Predictions]
) -> tuple[Where, ...]:
    """Say along which axes the squared error is concentrated, combined and by channel.

    A signal that is zero all the time has no size to combine its error by.
    `errors` are measured minus simulated, output to (N,) for each record.
    """
    outputs = list(errors[0])
    measured = [np.column_stack([r[n] for n in outputs]) for r in records]
    sizes = sizes_of(outputs, measured)
    size = dict(zip(outputs, np.maximum(sizes, 1e-300).tolist(), strict=True))
    moves = moving(outputs, measured)
    sized = [n for n, does in zip(outputs, moves, strict=True) if does] or outputs
    squared = np.concatenate([sum((e[n] / size[n]) ** 2 for n in sized) for e in errors])
    squared = np.asarray(squared, dtype=np.float64) / max(len(sized), 1)
    found = []
    for axis in axes.values():
        places = axis.places()
        place = np.concatenate(places)
        good = (place >= 0) & np.isfinite(squared)
        count = np.bincount(place[good], minlength=axis.count)
        total = np.bincount(place[good], weights=squared[good], minlength=axis.count)
        with np.errstate(invalid='ignore', divide='ignore'):
            percent = 100 * np.sqrt(np.where(count >= SAMPLES, total / count, np.nan))
        channels = {
            n: _channel_error(axis, records[0].units[n], [e[n] for e in errors]) for n in outputs
        }
        share = total / max(float(np.sum(total)), 1e-300)
        found.append(
            Where(
                axis.name, axis.unit, axis.edges, percent, share, count / max(place.size, 1),
                channels,
            )
        )  # fmt: skip
    return tuple(found)


def curves_by(
    model: Model, lacks: Sequence[Lack], axes: Mapping[str, Axis]
) -> list[Curve]:
    """Return what each equation lacks along each axis, with bands."""
    curves = []
    for name, unit in _equations(model, lacks):
        for axis in axes.values():
            drawn = curve_on(axis, lacking_name(model, name), unit, name, lacks)
            if drawn is not None:
                curves.append(drawn)
    return curves


def mean_in(axis: Axis, values: Sequence[Array]) -> Array:
    """Return the (B,) mean of values in the bins of an axis; NaN where a bin is empty."""
    place = np.concatenate(axis.places())
    joined = np.concatenate(values)
    good = place >= 0
    count = np.bincount(place[good], minlength=axis.count)
    total = np.bincount(place[good], weights=joined[good], minlength=axis.count)
    with np.errstate(invalid='ignore', divide='ignore'):
        mean: Array = total / count
    return mean


def centres_of(axis: Axis) -> Array:
    """Return the (B,) mean place of the samples of each bin, its middle where there is none."""
    middle = 0.5 * (axis.edges[1:] + axis.edges[:-1])
    if axis.name == 'direction':
        return middle
    mean = mean_in(axis, axis.values)
    inside = (mean >= axis.edges[:-1]) & (mean <= axis.edges[1:])
    return np.where(inside, mean, middle)


def curve_on(
    axis: Axis, quantity: str, unit: str, force: str, lacks: Sequence[Lack]
) -> Curve | None:
    """Return what one equation lacks along one axis; None where too few bins are filled."""
    binned = bin_means(axis.places(), [one.forces[force] for one in lacks], axis.count)
    known = np.isfinite(binned.band)
    if np.sum(known) < (2 if axis.name == 'direction' else FEWEST):
        return None
    return Curve(
        axis.name, axis.unit, quantity, unit, centres_of(axis)[known], binned.mean[known],
        binned.band[known], None, binned.chance(),
    )  # fmt: skip


def _channel_error(axis: Axis, unit: str, errors: Sequence[Array]) -> ChannelError:
    squares = [_smooth_square(e) for e in errors]
    overall = float(np.nanmean(np.concatenate(squares)))
    binned = bin_means(axis.places(), squares, axis.count)
    with np.errstate(invalid='ignore', divide='ignore'):
        rms = np.sqrt(np.maximum(binned.mean, 0.0))
        spread = np.minimum(0.5 * binned.band / np.maximum(binned.mean, 1e-300), LARGEST)
    low, high = rms * np.exp(-spread), rms * np.exp(spread)
    return ChannelError(unit, float(np.sqrt(overall)), rms, low, high, binned.chance(overall))


def _error_maps(
    axes: Mapping[str, Axis], records: Sequence[Record], errors: Sequence[Predictions]
) -> list[Map]:
    pair = _map_axes(axes)
    if pair is None:
        return []
    x, y = pair
    maps = []
    for name in errors[0]:
        squares = [_smooth_square(e[name]) for e in errors]
        binned = bin_means(_cells(x, y), squares, x.count * y.count)
        rms = np.sqrt(np.maximum(binned.mean, 0.0))
        with np.errstate(invalid='ignore', divide='ignore'):
            band = 0.5 * binned.band / rms
        maps.append(_map(x, y, f'{name} error', records[0].units[name], rms, band))
    return maps


def _force_maps(model: Model, lacks: Sequence[Lack], axes: Mapping[str, Axis]) -> list[Map]:
    pair = _map_axes(axes)
    if pair is None:
        return []
    x, y = pair
    maps = []
    for name, unit in _equations(model, lacks):
        values = [one.forces[name] for one in lacks]
        binned = bin_means(_cells(x, y), values, x.count * y.count)
        maps.append(_map(x, y, lacking_name(model, name), unit, binned.mean, binned.band))
    return maps


def _map_axes(axes: Mapping[str, Axis]) -> tuple[Axis, Axis] | None:
    """Return speed and current (or else the input), coarse enough for a map."""
    y = axes.get('current') or axes.get('input')
    if y is None:
        return None
    x = axes['speed']
    return (
        Axis(x.name, x.unit, x.values, np.linspace(x.edges[0], x.edges[-1], MAP_COLUMNS + 1)),
        Axis(y.name, y.unit, y.values, np.linspace(y.edges[0], y.edges[-1], MAP_ROWS + 1)),
    )


def _cells(x: Axis, y: Axis) -> list[NDArray[np.intp]]:
    return [
        np.where((a >= 0) & (b >= 0), b * x.count + a, -1)
        for a, b in zip(x.places(), y.places(), strict=True)
    ]


def _map(x: Axis, y: Axis, quantity: str, unit: str, value: Array, band: Array) -> Map:
    shape = (y.count, x.count)
    return Map(
        x.name, x.unit, y.name, y.unit, quantity, unit, x.edges, y.edges, value.reshape(shape),
        band.reshape(shape),
    )  # fmt: skip


def _equations(model: Model, lacks: Sequence[Lack]) -> list[tuple[str, str]]:
    """Return the equations whose lack is known on every record, with their units."""
    return [
        (f.name, linear_unit(f.unit) if model.linear else f.unit)
        for f in model.kind.forces
        if all(f.name in one.forces for one in lacks)
    ]


def _errors(record: Record, predicted: Predictions) -> dict[str, Array]:
    return {name: record[name] - values for name, values in predicted.items()}


def _smooth_square(error: Array) -> Array:
    square = error**2
    return smoothed(0.5 * (square[1:] + square[:-1]))
