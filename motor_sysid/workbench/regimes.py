"""Conditions of a motor at each sample: time regimes, and cells of a map of two signals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
Bins = NDArray[np.intp]

REGIMES = ('standstill', 'low speed', 'transient', 'steady')
"""In order of precedence: a sample belongs to the first that holds."""

STANDSTILL = 0.015
LOW_SPEED = 0.10
"""Limits of speed, as a share of the 99th percentile of its size."""

TRANSIENT = 0.15
"""Limit of acceleration, as a share of the 99th percentile of its size."""

SMOOTHING = 0.03
"""s over which speed is averaged before it is differentiated; shorter transients are none."""

FEWEST = 8
"""Samples that a cell of the map needs to be shown."""

LARGEST = 1e30
"""An error beyond this is that of a model that ran away."""

INPUTS = (
    'voltage', 'voltage_q', 'voltage_a', 'duty', 'torque', 'force', 'current', 'current_q',
    'voltage_command',
)  # fmt: skip
"""Signals for the second axis of the map if no current was measured, best first."""

SPEED_UNITS = {'rad': 'rad/s', 'm': 'm/s'}


def speed_of(record: Record) -> Array | None:
    """Return measured speed, else the smoothed derivative of position, else None."""
    if 'speed' in record:
        return record['speed']
    if 'position' in record:
        return _slope(record['position'], record)
    return None


def speed_unit(record: Record) -> str:
    """Return the unit of what `speed_of` returns."""
    if 'speed' in record:
        return record.units['speed']
    return SPEED_UNITS.get(record.units.get('position', ''), '1/s')


def regimes_of(records: Sequence[Record], sigma: float = 0.0) -> tuple[Bins, ...] | None:
    """Return for each record the (N,) index into `REGIMES`, or None without speed.

    Parameters
    ----------
    sigma:
        Standard deviation of the noise of speed; within three of it the motor stands still.
    """
    speeds = [speed_of(record) for record in records]
    known = [speed for speed in speeds if speed is not None]
    if len(known) < len(records):
        return None
    slopes = [_slope(speed, r) for speed, r in zip(known, records, strict=True)]
    scale = _size(known)
    noise = max(_slope_noise(a, r) for a, r in zip(slopes, records, strict=True))
    limit = min(max(TRANSIENT * _size(slopes), 4 * noise), 0.5 * _size(slopes))
    still = max(STANDSTILL * scale, 3 * sigma)
    slow = max(LOW_SPEED * scale, still)
    return tuple(
        np.select([abs(v) < still, abs(v) < slow, _lasting(abs(a) > limit, r)], [0, 1, 2], 3)
        for v, a, r in zip(known, slopes, records, strict=True)
    )  # fmt: skip


@dataclass(frozen=True)
class Grid:
    """Cells of a map.

    Attributes
    ----------
    x, y:
        Names of the signals.
    x_unit, y_unit:
        Their units.
    x_edges, y_edges:
        (nx + 1,) and (ny + 1,) edges; samples outside belong to the outermost cells.
    cells:
        For each record the (N,) cell of each sample, ``row * nx + column``, -1 for none.
    """

    x: str
    y: str
    x_unit: str
    y_unit: str
    x_edges: Array
    y_edges: Array
    cells: tuple[Bins, ...]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows (y) and columns (x)."""
        return len(self.y_edges) - 1, len(self.x_edges) - 1


def grid_of(records: Sequence[Record], samples: int) -> Grid | None:
    """Return a map of speed and current (or else an input), fine enough for `samples`."""
    speeds = [speed_of(record) for record in records]
    y = next((name for name in ('current', *INPUTS) if all(name in r for r in records)), None)
    xs = [speed for speed in speeds if speed is not None]
    if y is None or len(xs) < len(records):
        return None
    ys = [record[y] for record in records]
    columns = int(np.clip(np.sqrt(samples / 12), 7, 30))
    x_edges, y_edges = _edges(xs, columns), _edges(ys, max(5, round(0.7 * columns)))
    return Grid(
        'speed', y, speed_unit(records[0]), records[0].units[y], x_edges, y_edges,
        tuple(_cells(x, v, x_edges, y_edges) for x, v in zip(xs, ys, strict=True)),
    )  # fmt: skip


def rms_by(bins: Bins, errors: Array, count: int) -> tuple[Array, Array]:
    """Return RMS error and number of samples of each bin; both (count,).

    Samples whose error is not finite (or beyond any use) or whose bin is negative are left out;
    an empty bin has NaN.
    """
    good = (np.abs(errors) < LARGEST) & (bins >= 0)
    number = np.bincount(bins[good], minlength=count).astype(np.float64)
    squares = np.bincount(bins[good], weights=errors[good] ** 2, minlength=count)
    with np.errstate(invalid='ignore', divide='ignore'):
        return np.sqrt(squares / number), number


def _size(parts: Sequence[Array]) -> float:
    values = np.abs(np.concatenate(parts))
    finite = values[np.isfinite(values)]
    return float(np.percentile(finite, 99)) if finite.size else 0.0


def _window(record: Record) -> int:
    return int(np.clip(round(SMOOTHING / record.dt), 1, max(1, len(record) // 4)))


def _slope(values: Array, record: Record) -> Array:
    """Return the slope of `values`, averaged over a window, per s."""
    window = _window(record)
    smooth = _mean(values, window)
    ahead = np.minimum(np.arange(len(values)) + window, len(values) - 1)
    back = np.maximum(np.arange(len(values)) - window, 0)
    slope: Array = (smooth[ahead] - smooth[back]) / (record.time[ahead] - record.time[back])
    return slope


def _lasting(flags: NDArray[np.bool_], record: Record) -> NDArray[np.bool_]:
    """Return which samples have the flag in most of their surroundings: noise flickers."""
    most: NDArray[np.bool_] = _mean(flags.astype(np.float64), 2 * _window(record)) > 0.5
    return most


def _slope_noise(slope: Array, record: Record) -> float:
    """Return the standard deviation of a slope about its moving average, where it is calm."""
    off = np.abs(slope - _mean(slope, 8 * _window(record)))
    finite = off[np.isfinite(off)]
    return float(np.percentile(finite, 10)) / 0.126 if finite.size else 0.0


def _mean(values: Array, window: int) -> Array:
    """Return the centred moving average over `window` samples, shorter at the ends."""
    total = np.concatenate(([0.0], np.cumsum(np.nan_to_num(values))))
    first = np.maximum(np.arange(len(values)) - window // 2, 0)
    last = np.minimum(first + window, len(values))
    mean: Array = (total[last] - total[first]) / (last - first)
    return mean


def _edges(parts: Sequence[Array], count: int) -> Array:
    values = np.concatenate(parts)
    values = values[np.isfinite(values)]
    low, high = np.percentile(values, [0.2, 99.8]) if values.size else (0.0, 1.0)
    if high <= low:
        low, high = low - 0.5, high + 0.5
    return np.linspace(low, high, count + 1)


def _cells(x: Array, y: Array, x_edges: Array, y_edges: Array) -> Bins:
    columns, rows = len(x_edges) - 1, len(y_edges) - 1
    column = np.clip(np.searchsorted(x_edges, x, side='right') - 1, 0, columns - 1)
    row = np.clip(np.searchsorted(y_edges, y, side='right') - 1, 0, rows - 1)
    return np.where(np.isfinite(x) & np.isfinite(y), row * columns + column, -1)
