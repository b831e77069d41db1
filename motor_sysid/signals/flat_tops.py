"""Flat tops: a sensor at the end of its range shows that, whatever lies beyond it.

A current in steps of its converter changes from sample to sample, by noise alone.  One that stays
at its largest value for several samples, again and again or for long, is cut off there.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.checks.common import runs

Array = NDArray[np.float64]

AT_LIMIT = 0.001
"""Share of samples at the largest value from which a signal counts as cut off there."""

IN_A_ROW, LONG = 3, 10
"""Equal samples in a row that are no chance, in two places; and in one."""

USUAL = 2
"""Samples in a row that most other values may stay: of what stays longer nothing is told, as of
what stays as long at some other value but zero."""


def limits_of(values: Array) -> tuple[float, float]:
    """Return the smallest and the largest value that a sensor can show, infinite if not told.

    Parameters
    ----------
    values:
        (N,) measured values, stray samples mended: one of them may lie beyond the limit.  Of
        values that are not finite nothing is told.
    """
    starts, lengths = runs(values)
    level, ends = values[starts], (float(np.min(values)), float(np.max(values)))
    others = lengths[(level != 0) & ~np.isin(level, ends)]
    if others.size == 0 or np.median(others) > USUAL:
        return -np.inf, np.inf
    low, high = (
        end if end != 0 and _is_flat(lengths[level == end], int(np.max(others)), values.size)
        else outside
        for end, outside in zip(ends, (-np.inf, np.inf), strict=True)
    )  # fmt: skip
    return low, high


def share_at(values: Array, limit: float) -> float:
    """Return the share of (N,) values that stay at a limit for several samples."""
    starts, lengths = runs(values)
    there = lengths[(values[starts] == limit) & (lengths >= IN_A_ROW)]
    return float(np.sum(there)) / values.size


def _is_flat(lengths: NDArray[np.intp], elsewhere: int, count: int) -> bool:
    """Whether stays of these lengths at a limit are no chance; the longest one `elsewhere`."""
    stays = lengths[lengths >= IN_A_ROW]
    again = stays.size > 1 and np.sum(stays) >= AT_LIMIT * count
    return bool(np.max(lengths, initial=0) > elsewhere and (again or np.any(stays >= LONG)))
