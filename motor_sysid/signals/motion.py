"""Speed and acceleration of recorded positions, for models that take a motion as given."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

WINDOW, DEGREE = 11, 3
"""Samples and degree of the polynomial that stands for the motion around each sample."""

RESTING = 0.05
"""Share of the RMS of the speed below which a motor has no direction."""

SAME = 1.05
"""Reversals over those that are seen over twice the time, up to which they are the same."""

FEWEST = 500
"""Rows that are left of a record, at least."""


def with_motion(records: Sequence[Record]) -> list[Record]:
    """Return uniform records of one step with the speed and the acceleration that they lack.

    Both are derivatives of a cubic over eleven rows around each one (Savitzky and Golay, Anal.
    Chem. 36 (1964) 1627): of the speed where it is measured, else of the position.  A position
    that creeps from count to count, or from stop to stop, does not tell a direction within a few
    samples: then rows are averaged in twos until there are no fewer reversals over twice the time.
    Records with neither speed nor position, or shorter than eleven rows, are returned as they are.
    """
    times = max((_halvings(record) for record in records), default=0)
    return [_differentiated(_slower(record, times)) for record in records]


def _halvings(record: Record) -> int:
    """Return how many times rows are to be averaged in twos for a direction to be told."""
    if 'speed' in record or 'position' not in record or len(record) <= WINDOW:
        return 0
    times, seen = 0, _reversals(record)
    while len(record) // 2 >= FEWEST:
        record = _slower(record, 1)
        fewer = _reversals(record)
        if seen <= SAME * fewer:
            return times
        times, seen = times + 1, fewer
    return 0


def _reversals(record: Record) -> int:
    speed = _derivative(record['position'], record.dt)
    moving = speed[np.abs(speed) > RESTING * float(np.sqrt(np.mean(speed**2)))]
    return int(np.count_nonzero(np.diff(np.sign(moving))))


def _slower(record: Record, times: int) -> Record:
    """Return the record with means of two rows in place of them, that many times."""
    for _ in range(times):
        pairs = len(record) // 2
        half = {
            name: values[: 2 * pairs].reshape(pairs, 2).mean(axis=1)
            for name, values in record.signals.items()
        }
        time = record.time[: 2 * pairs].reshape(pairs, 2).mean(axis=1)
        record = Record(time, half, record.units, record.provenance)
    return record


def _derivative(values: Array, dt: float, order: int = 1) -> Array:
    found: Array = savgol_filter(values, WINDOW, DEGREE, deriv=order, delta=dt)
    return found


def _differentiated(record: Record) -> Record:
    told = next((name for name in ('speed', 'position') if name in record), '')
    if not told or len(record) <= WINDOW:
        return record
    length = record.units[told].split('/')[0]
    for name, unit, order in (('speed', 's', 1), ('acceleration', 's^2', 2)):
        if name not in record:
            values = _derivative(record[told], record.dt, order - (told == 'speed'))
            record = record.with_signal(name, values, f'{length}/{unit}')
    return record
