"""By how much a recorded speed is behind the motion of the recorded position."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.record import Record
from motor_sysid.signals.slow_updates import slow_signals

Array = NDArray[np.float64]

SPANS = (1, 2, 4, 8, 16, 32, 64, 128, 256)
"""Rows over which changes are taken: few where the speed is noisy, many where the position is."""
FEWEST, SINGULAR = 50, 1e6
"""Changes that are needed, and the condition from which on they cannot be told apart."""


@dataclass(frozen=True)
class Lateness:
    """How late a speed is shown.

    Attributes
    ----------
    seconds, sigma:
        Time by which it is behind the motion of the position, and its standard error, s.  A low
        pass of first order counts with its time constant, a difference of the position over the
        last sample with half of that, the speed of the moment with nothing.
    """

    seconds: float
    sigma: float


def speed_lateness(records: Sequence[Record]) -> Lateness | None:
    """Return how late the speed of records is shown; None where they do not tell.

    What a filter of first order, ``T y' + y = omega``, shows adds up to the angle but for ``T y``:
    so T is the slope of ``theta - integral y dt`` over y, beside those of a scale of the speed and
    of an offset.  No signal is differentiated.  Changes are taken over so many rows as tell it
    best; they do not overlap, so that their errors are nearly independent.

    Parameters
    ----------
    records:
        Records of one motor; those without position and speed, or where one of them is not new in
        every row, are left out.
    """
    both = {'position', 'speed'}
    told = [r for r in records if both <= {*r} and not both & {*r.samples}]
    told = [r for r in told if np.ptp(r['speed']) > 0.0]
    if both & {one.name for one in slow_signals(told)}:
        return None
    found = [_over(told, span) for span in SPANS] if told else []
    known = [one for one in found if one is not None and np.isfinite(one.sigma)]
    return min(known, key=lambda one: one.sigma, default=None)


def _over(records: Sequence[Record], span: int) -> Lateness | None:
    """Return what changes over so many rows tell."""
    parts = [_changes(record, span) for record in records if len(record) > span]
    rows = np.concatenate(parts) if parts else np.empty((0, 5))
    if len(rows) < FEWEST:
        return None
    size = np.sqrt(np.mean(rows**2, axis=0))
    if not np.all(size[1:] > 0.0):
        return None
    left, columns, slope = rows[:, 0], rows[:, 1:4] / size[1:4], rows[:, 4] / size[4]
    instruments = np.column_stack((slope, columns[:, 1:]))
    mixed = instruments.T @ columns
    if np.linalg.cond(mixed) > SINGULAR:
        return None
    slopes = np.linalg.solve(mixed, instruments.T @ left)
    rest = left - columns @ slopes
    half = np.linalg.solve(mixed, instruments.T)
    sigma = np.sqrt(half[0] @ half[0] * (rest @ rest) / (len(rows) - 3))
    return Lateness(float(slopes[0] / size[1]), float(sigma / size[1]))


def _changes(record: Record, span: int) -> Array:
    """Return (K, 5) changes: of what the speed does not add up to, speed, angle, time, slope."""
    speed, time, angle = record['speed'], record.time, record['position']
    added = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))))
    columns = np.column_stack((angle - added, speed, angle, time, np.gradient(angle, time)))
    return np.diff(columns[::span], axis=0)
