"""Free functions of one axis (or two), as columns of a regression on what an equation lacks."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.where.axes import Axis, FAR, OWN_TIME
from motor_sysid.diagnosis.where.orthogonal_rows import Rows
from motor_sysid.diagnosis.where.shapes import slow_orders, standing_orders
from motor_sysid.diagnosis.where.where import Failure
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

CONSTANT, RECENT, FRICTION = 'constant', 'recent input', 'dry friction'
OVER = ' over '
"""Names of what is no axis of its own; a parameter over time is ``PARAMETER over CLOCK``."""

KNOTS = 12
"""Knots on each side of zero; twice as many on other axes."""

DRIFT_KNOTS = 9

LAGS = (0, 1, 2, 3, 5, 8, 13, 21)
"""Samples by which the input may be late."""


def free_functions(
    model: Model, failure: Failure, axes: Mapping[str, Axis], rows: Rows
) -> dict[str, Array]:
    """Return axis to the columns of a free function of it, simplest first."""
    order = ('speed', 'current', 'input', 'position', FAR, 'temperature', OWN_TIME, 'time')
    found = {CONSTANT: rows.take([np.ones((size, 1)) for size in rows.sizes])}
    for axis in (axes[name] for name in order if name in axes):
        found[axis.name] = free_function(axis, rows)
    for name in (OWN_TIME, 'time'):
        if name in axes:
            found.update(drifts(model, failure, axes[name], rows))
    drive = next((b.drive.signals for b in model.kind.balances if b.force == rows.force), ())
    if drive and all(drive[0] in one.states for one in failure.lacks):
        found[RECENT] = rows.take([_lagged(o.states[drive[0]]) for o in failure.lacks])
    speed = failure.axes['speed']
    other = next((failure.axes[n] for n in ('current', 'input') if n in failure.axes), None)
    if other is not None:
        pairs = zip(speed.values, other.values, strict=True)
        reach = speed.edges[-1], other.edges[-1]
        found[f'speed and {other.name}'] = rows.take([_product(x, y, reach) for x, y in pairs])
    return found


def drifts(model: Model, failure: Failure, clock: Axis, rows: Rows) -> dict[str, Array]:
    """Return ``PARAMETER over CLOCK`` to the columns of a parameter that is free in time.

    Only parameters that stand in this equation alone, and dry friction for a torque.
    """
    knots = np.linspace(clock.edges[0], clock.edges[-1], DRIFT_KNOTS)
    own = [t.parameter for b in model.kind.balances if b.force == rows.force for t in b.terms]
    found = {}
    for name in own:
        terms = [one.terms[rows.force].get(name) for one in failure.lacks]
        known = [term for term in terms if term is not None]
        if len(known) == len(terms):
            pairs = zip(known, clock.values, strict=True)
            found[f'{name}{OVER}{clock.name}'] = np.concatenate(
                [(term[:, np.newaxis] * hats(t, knots))[:: rows.every] for term, t in pairs]
            )
    if rows.force == 'torque':
        ways = zip(failure.axes['direction'].values, clock.values, strict=True)
        found[f'{FRICTION}{OVER}{clock.name}'] = rows.take(
            [way[:, np.newaxis] * hats(t, knots) for way, t in ways]
        )
    return found


def free_function(axis: Axis, rows: Rows) -> Array:
    """Return (K, k) columns of a free function of an axis."""
    waves: list[float] = []
    if axis.name == 'position' and axis.unit == 'rad':
        waves = sorted({1, 2, 3, 4, *standing_orders(rows.thin(axis.values), rows.target)})
    elif axis.name == FAR:
        slow = slow_orders(rows.thin(axis.values), rows.target)
        waves = [m * n for n in slow for m in (1, 2)]
    return rows.take([_columns(axis, v, waves) for v in axis.values])


def _columns(axis: Axis, x: Array, waves: Sequence[float]) -> Array:
    """Return (N, k) columns for one record's values, with waves of these numbers per turn."""
    low, high = axis.edges[[0, -1]]
    swings = [f(n * x) for n in waves for f in (np.sin, np.cos)]
    if axis.name in ('speed', 'current', 'input'):
        knots = high * np.concatenate(([0.0], np.geomspace(0.02, 1.0, KNOTS)))
        ahead = hats(np.abs(x), knots)
        back = (x < 0)[:, np.newaxis]
        return np.concatenate([np.where(back, 0.0, ahead), np.where(back, ahead, 0.0)], axis=1)
    if axis.name == 'position' and axis.unit == 'rad':
        return np.stack([np.ones_like(x), *swings], axis=1)
    return np.column_stack([hats(x, np.linspace(low, high, 2 * KNOTS)), *swings])


def hats(x: Array, knots: Array) -> Array:
    """Return (K, k) piecewise linear functions, one for each knot, constant outside."""
    eye = np.eye(knots.size)
    return np.stack([np.interp(x, knots, row) for row in eye], axis=1)


def _product(x: Array, y: Array, reach: tuple[float, float]) -> Array:
    """Return hat functions of both, four knots on each side of zero."""
    knots = np.array([-1, -0.4, -0.1, -0.02, 0.02, 0.1, 0.4, 1])
    one, other = (hats(v, r * knots) for v, r in zip((x, y), reach, strict=True))
    return (one[:, :, np.newaxis] * other[:, np.newaxis, :]).reshape(x.size, -1)


def _lagged(values: Array) -> Array:
    """Return (N, lags) earlier values, the first one held before the start."""
    index = np.arange(values.size)
    return np.stack([values[np.maximum(index - lag, 0)] for lag in LAGS], axis=1)
