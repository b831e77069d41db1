"""Flat tops: a sensor at the end of its range shows that, whatever lies beyond it.

A current in steps of its converter changes from sample to sample, by noise alone.  One that stays
at its largest value for several samples, again and again or for long, is cut off there, and so is
one that jumps to it, stays for several samples, and leaves it by a jump.  So is a largest value
that lies as many steps from zero as a converter of some bits has there, if none on the other side
lies further: its range is as wide there.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.held import runs
from motor_sysid.signals.lattice import lattice

Array = NDArray[np.float64]

AT_LIMIT = 0.001
"""Share of samples at the largest value from which a signal counts as cut off there."""

IN_A_ROW, LONG = 3, 10
"""Equal samples in a row that are no chance, in two places; and in one."""

CLIFF, MANY = 5.0, 20
"""Steps of the converter that a jump has at least; and stays beside jumps at other large values
that are all shorter, from which on two equal samples in a row, and one more, are no chance."""

BITS, OFF = 9, 0.1
"""Bits from which on a number of steps is hardly chance: two of the five hundred around 512 are
such; and how far it may be off by printing."""

ALIKE = 1e-3
"""Share by which the ends of a range may differ: a converter has one step more on one side."""

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
    inside = (level != 0) & ~np.isin(level, ends)
    if not np.any(inside) or np.median(lengths[inside]) > USUAL:
        return -np.inf, np.inf
    jumps, steps = _jumps(level), lattice(values)

    def is_limit(end: float) -> bool:
        there, large = level == end, np.abs(level) > 0.5 * abs(end)
        between, beside = np.all(jumps, axis=0), np.any(jumps, axis=0)
        at_jumps, longest = lengths[there & beside], np.max(lengths[inside & beside], initial=0)
        at_end = at_jumps.size > 0 and (1 + ALIKE) * abs(end) >= max(map(abs, ends))
        return bool(end) and (
            _is_flat(lengths[there], int(np.max(lengths[inside])), values.size)
            or _is_cut(lengths[there & between], lengths[inside & between])
            or _is_cut_again(at_jumps, lengths[inside & beside & large], int(longest))
            or (at_end and steps is not None and _ends_bits(abs(end) / steps.step))
        )

    low, high = ends
    return (low if is_limit(low) else -np.inf), (high if is_limit(high) else np.inf)


def common_limits(series: Sequence[Array]) -> tuple[float, float]:
    """Return the ends of the range of a sensor that (N_k,) values of several records show.

    What one record shows holds for all; a range that ends on one side ends as far from zero on the
    other, where that is as far as any value goes.
    """
    told = [limits_of(values) for values in series]
    low = min((one for one, _ in told if np.isfinite(one)), default=-np.inf)
    high = max((one for _, one in told if np.isfinite(one)), default=np.inf)
    least, most = min(map(np.min, series)), max(map(np.max, series))
    if np.isinf(low) and abs(high + least) <= ALIKE * high < np.inf:
        low = float(least)
    if np.isinf(high) and abs(low + most) <= -ALIKE * low < np.inf:
        high = float(most)
    return (low if least >= low else -np.inf), (high if most <= high else np.inf)


def _is_flat(lengths: NDArray[np.intp], elsewhere: int, count: int) -> bool:
    """Whether stays of these lengths at a limit are no chance; the longest one `elsewhere`."""
    stays = lengths[lengths >= IN_A_ROW]
    again = stays.size > 1 and np.sum(stays) >= AT_LIMIT * count
    return bool(np.max(lengths, initial=0) > elsewhere and (again or np.any(stays >= LONG)))


def _is_cut(lengths: NDArray[np.intp], elsewhere: NDArray[np.intp]) -> bool:
    """Whether a stay between jumps is no chance: several samples, and none as long elsewhere."""
    longest = np.max(lengths, initial=0)
    return bool(longest >= IN_A_ROW and longest > np.max(elsewhere, initial=0))


def _is_cut_again(
    lengths: NDArray[np.intp], large: NDArray[np.intp], elsewhere: int
) -> bool:
    """Whether stays beside jumps are no chance: longer than all at other `large` values.

    At small values a current is for longer, and comes back to one of them by noise; but what is as
    long `elsewhere` as ten samples is the logger's.
    """
    longest = np.max(lengths, initial=0)
    several = longest > 1 and np.sum(lengths) >= IN_A_ROW
    alone = large.size >= MANY and longest > np.max(large)
    return bool(several and alone and (longest < LONG or longest > elsewhere))


def _ends_bits(count: float) -> bool:
    """Whether so many steps are all that a converter has on one side of zero."""
    whole = round(count)
    bits = (whole + 1).bit_length() - 1
    return bits >= BITS and whole in (2**bits, 2**bits - 1) and abs(count - whole) < OFF


def _jumps(level: Array) -> NDArray[np.bool_]:
    """Return (2, S) whether a stay at a level begins, and ends, with a jump, for (S,) stays."""
    step = np.min(np.diff(np.unique(level)))
    far = np.abs(np.diff(level)) >= CLIFF * step
    return np.stack([np.append(True, far), np.append(far, True)])
