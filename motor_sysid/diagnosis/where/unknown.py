"""What the catalogue does not know: on which axis the lacking force lives, and its shape.

A free function of each axis is fitted beside the base parameters and judged in blocks of time that
it was not fitted to: the share of the lacking force beyond sensor noise that it predicts there.
The axis with the largest share is named, a simpler one where it does nearly as well; then simple
shapes are tried on it (`shapes`).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.curves import Curve
from motor_sysid.diagnosis.result.figures import with_unit
from motor_sysid.diagnosis.result.findings import AxisShare, Unknown
from motor_sysid.diagnosis.where.axes import Axis, driven, FAR, INPUT, many_turns, own_time
from motor_sysid.diagnosis.where.equation_errors import lacking_name
from motor_sysid.diagnosis.where.free_functions import (
    CONSTANT,
    DRIFT_KNOTS,
    drifts,
    free_function,
    free_functions,
    OVER,
    RECENT,
)
from motor_sysid.diagnosis.where.orthogonal_rows import Rows, rows_of
from motor_sysid.diagnosis.where.shapes import PROPORTION, Shape, shapes_of
from motor_sysid.diagnosis.where.where import curve_on, Failure
from motor_sysid.physics.model import linear_unit, Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

FAINT = 0.1
"""What is lacking counts for at least this share of the sensor noise."""

SIMPLER = 0.93
"""A simpler axis is named if it explains this share of what the best one explains."""

LEAST_SHARE, LEAST_CERTAINTY = 0.2, 3.0
"""Share and certainty below which no axis is named."""

CATCH_ALL = 0.75
"""An axis is named rather than the input, recent or not, which mimics many, if it explains this
share."""

PLAIN = 0.95
"""A shape with fewer columns is named if it explains this share."""

HALF = 0.5
"""Share of what is beyond noise from which on the best axis is named, though it is not told."""

SIMPLE = 0.7
"""A shape is named if it explains this share of what a free function of the axis explains."""


@dataclass(frozen=True)
class _Best:
    """The best shape on an axis."""

    shape: Shape
    coefficients: Array
    explained: float


def unknown_of(
    model: Model,
    records: Sequence[Record],
    failure: Failure,
    sigmas: Mapping[str, float],
) -> tuple[Unknown, ...]:
    """Say for each equation on which axis lives what it lacks, the clearest first.

    Parameters
    ----------
    model, records, failure:
        The last model, the uniform records that it was run over, and where it fails.
    sigmas:
        Output to the standard deviation of its sensor noise.
    """
    found = [
        _unknown(model, records, failure, rows)
        for rows in rows_of(model, failure.lacks, failure.share, records[0].dt, sigmas)
    ]
    found.sort(key=lambda u: -max(u.share, 0.0) * u.rms**2 / max(u.noise**2, 1e-300))
    return tuple(found)


def _unknown(
    model: Model, records: Sequence[Record], failure: Failure, rows: Rows
) -> Unknown:
    quantity = lacking_name(model, rows.force)
    unit = next(f.unit for f in model.kind.forces if f.name == rows.force)
    unit = linear_unit(unit) if model.linear else unit
    states = [one.states for one in failure.lacks]
    further = {**driven(model, records, states), **many_turns(model, states), **own_time(records)}
    axes = {**failure.axes, **further}
    shares = tuple(
        AxisShare(rows.force, quantity, unit, name, *share_and_certainty(rows, columns))
        for name, columns in free_functions(model, failure, axes, rows).items()
    )
    best = _named(shares)
    ordered = tuple(
        replace(a, best=a.axis == best) for a in sorted(shares, key=lambda a: -a.share)
    )
    plain = Unknown(
        rows.force, quantity, unit, float(np.sqrt(rows.power)), float(np.sqrt(rows.noise)), best,
        max((a.share for a in shares if not best or a.axis == best), default=0.0),
        '', float('nan'), '', ordered,
    )  # fmt: skip
    if not best:
        return replace(plain, words=_nowhere(plain))
    if best == CONSTANT:
        size = rows.fitted(rows.take([np.ones((n, 1)) for n in rows.sizes]))[0]
        plain = replace(plain, shape='a constant', amplitude=float(size[0]))
    if OVER in best:
        return _drifted(plain, model, axes[best.split(OVER)[1]], failure, rows)
    axis = axes.get(best)
    curve = None if axis is None else curve_on(axis, quantity, unit, rows.force, failure.lacks)
    if axis is None or curve is None:
        return replace(plain, words=_somewhere(plain))
    return _with_shape(plain, curve, axis, rows)


def _with_shape(plain: Unknown, curve: Curve, axis: Axis, rows: Rows) -> Unknown:
    free = rows.fitted(free_function(axis, rows))[1]
    thin = rows.thin(axis.values)
    best = _best_shape(rows, shapes_of(plain.axis, axis.unit, thin, rows.target), axis)
    if best is None or best.explained < SIMPLE * (rows.power - free):
        return replace(plain, curve=curve, words=_somewhere(plain))
    amplitude = float(np.quantile(np.abs(best.shape.columns(thin) @ best.coefficients), 0.995))
    law = rows.beyond(rows.take([best.shape.columns(v) for v in axis.values]))
    bins = np.concatenate([place[:: rows.every] for place in axis.places()])
    count = np.bincount(bins, minlength=axis.count)
    total = np.bincount(bins, weights=law @ best.coefficients, minlength=axis.count)
    shown = np.clip(np.digitize(curve.x, axis.edges) - 1, 0, axis.count - 1)
    drawn = replace(curve, law=(total / np.maximum(count, 1))[shown])
    named = replace(plain, shape=best.shape.words, amplitude=amplitude, curve=drawn)
    against = best.shape.signed and best.coefficients[0] < 0 and plain.axis == 'speed'
    return replace(named, words=_somewhere(named, ' against the motion' if against else ''))


def _drifted(
    plain: Unknown, model: Model, clock: Axis, failure: Failure, rows: Rows
) -> Unknown:
    """Return how the parameter goes over time, as a curve with its band."""
    name = plain.axis.split(OVER)[0]
    columns = drifts(model, failure, clock, rows)[plain.axis]
    change, band = rows.jackknife(columns)
    unit, size, sign = plain.unit, 1.0, -1.0
    if name in model.parameters:
        unit, size = '%', 0.01 * abs(model[name])
    knots = np.linspace(clock.edges[0], clock.edges[-1], DRIFT_KNOTS)
    mean = sign * change / size
    if any(p.name == name for p in model.parameters.free):
        mean -= np.mean(mean)  # its level was fitted
    curve = Curve(clock.name, 's', f'change of {name}', unit, knots, mean, band / size)
    sure = band < 2 * np.abs(change).max()
    known = np.where(sure, mean, np.nan) if np.any(sure) else mean
    ends = sorted((int(np.nanargmin(known)), int(np.nanargmax(known))))
    span = ' to '.join(
        f'{with_unit(float(known[k]), unit, 2)} at {knots[k]:.3g} s' for k in ends
    )
    words = (
        f'The {plain.quantity} looks like {name} changing with time: from {span}, against its '
        f'fitted value ({100 * plain.share:.0f} % of what is beyond sensor noise).'
    )
    amplitude = float(np.nanmax(known) - np.nanmin(known))
    return replace(plain, shape='changes with time', amplitude=amplitude, words=words, curve=curve)


def _best_shape(rows: Rows, shapes: Iterable[Shape], axis: Axis) -> _Best | None:
    """Return the shape with the least price: misfit, parameters and the choice among its kind.

    One with fewer columns is preferred if it explains nearly as much.
    """
    independent = rows.target.size / 4
    tried: list[tuple[float, _Best]] = []
    for shape in shapes:
        columns = rows.take([shape.columns(v) for v in axis.values])
        coefficients, left = rows.fitted(columns)
        price = independent * np.log(max(left, 1e-300)) + 2 * np.log(shape.choices)
        price += columns.shape[1] * np.log(independent)
        tried.append((price, _Best(shape, coefficients, rows.power - left)))
    if not tried:
        return None
    best = min(tried, key=lambda one: one[0])[1]
    plain = [
        (price, one)
        for price, one in tried
        if one.coefficients.size < best.coefficients.size
        and one.explained > PLAIN * best.explained
    ]
    return min(plain, key=lambda one: one[0])[1] if plain else best


def share_and_certainty(rows: Rows, columns: Array) -> tuple[float, float]:
    """Return which share of what is lacking (K, k) columns predict, and how sure that is.

    It is beyond sensor noise and in blocks of time that they were not fitted to; the second is the
    gain in units of its standard error.
    """
    explained, certainty = rows.explained(rows.predicted(columns))
    whole = max(rows.power - rows.noise, FAINT * rows.noise, explained, 1e-300)
    return float(np.clip(explained / whole, 0.0, 1.0)), certainty


def _named(axes: Sequence[AxisShare]) -> str:
    """Return the first (simplest) axis that explains nearly as much as the best; or none.

    Where the current is measured, what a drive does to the input follows that, and so does a
    function of speed and current, for these two make up the input.
    """
    clear = {
        a.axis: a.share for a in axes
        if a.share >= LEAST_SHARE and a.certainty >= LEAST_CERTAINTY
    }  # fmt: skip
    beside = any(a.axis == 'current' for a in axes)
    recent, driven = clear.pop(RECENT, 0.0), clear.pop(INPUT, 0.0) if beside else 0.0
    most = max(clear.values(), default=0.0)
    if most < CATCH_ALL * max(recent, driven):
        return INPUT if driven >= SIMPLER * recent else RECENT
    found = next((axis for axis, share in clear.items() if share >= SIMPLER * most), '')
    both = found == 'speed and current'
    return INPUT if both and driven >= SIMPLER * clear[found] else found


def _somewhere(found: Unknown, direction: str = '') -> str:
    share = f'{100 * found.share:.0f} % of what is beyond sensor noise'
    size = f'{with_unit(found.rms, found.unit)} RMS'
    if found.axis == CONSTANT:
        size = with_unit(found.amplitude, found.unit)
        return f'The {found.quantity} is a constant, {size} ({share}).'
    if not found.shape:
        return (
            f'The {found.quantity} looks like a function of {found.axis}, of no simple shape '
            f'({share}; {size}).'
        )
    alike = ''
    if found.axis == FAR:
        source = 'the torque of a spring' if found.shape == PROPORTION else 'a load behind a gear'
        alike = f', as {source} does'
    return (
        f'The {found.quantity} looks like a function of {found.axis}: {found.shape}{alike}, '
        f'{with_unit(found.amplitude, found.unit)}{direction} ({share}).'
    )


def _nowhere(found: Unknown) -> str:
    size = f'{with_unit(found.rms, found.unit)} RMS'
    if found.rms < 1.2 * found.noise:
        return f'The {found.quantity} ({size}) is no more than sensor noise makes.'
    best = found.axes[0] if found.axes else None
    tail = f'; the best, {best.axis}, explains {100 * best.share:.0f} %' if best else ''
    if best and best.share > HALF:
        return (
            f'The {found.quantity} ({size}, sensor noise makes '
            f'{with_unit(found.noise, found.unit)}) goes most with {best.axis} '
            f'({100 * best.share:.0f} %), but these data do not tell that for certain.'
        )
    return (
        f'The {found.quantity} ({size}, sensor noise makes '
        f'{with_unit(found.noise, found.unit)}) is no function of any axis that was tried{tail}.'
    )
