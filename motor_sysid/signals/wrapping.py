"""Positions that start anew at the end of their sensor's range, and how large that range is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.units import TURN

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ROUNDED = 5e-3
"""Share of a turn by which values may reach over it: decimals that were cut off."""
WHOLE = 0.8
"""Share of a turn that a jump must have at least once to be taken for one."""
SMALL = 0.02
"""Share of a turn by which a step over the end may differ from those beside it, in any case."""
SLOW = 0.25
"""Share of an unknown range that usual steps may have."""
NEIGHBOURS = 3
"""Steps on each side that tell in which direction it moved when it jumped."""
AGREEING, TELLING = 0.8, 0.5
"""Shares of the jumps that must be of one size, and of which the neighbours tell the motion."""
SPARED = 1000
"""Samples of which one may lie beyond the range."""
CERTAIN, ONE_WAY = 3, 5
"""Jumps that prove a range, and where it always turns one way, as what returns fast does, too."""


@dataclass(frozen=True)
class Wrap:
    """A position that jumps from one end of its range to the other.

    Attributes
    ----------
    period:
        Length of the range, after which it starts anew, in rad.
    places:
        Samples before the jumps.
    certain:
        Whether nothing else explains it: a turn, or several jumps of one size.
    """

    period: float
    places: NDArray[np.intp]
    certain: bool


def find_wrap(position: Array, unit: float = 1.0) -> Wrap | None:
    """Find out whether a position starts anew at the end of a range; None if it does not.

    A range of one turn shows in jumps of most of it, within values that span no more.  Another one
    shows in jumps of one size, from one end of the values to the other, each against the motion
    right before and right after it: no motor moves like that, but for a sensor that starts anew.

    Parameters
    ----------
    position:
        (N,) rad; values that are not finite are passed over.
    unit:
        Size in rad of the unit in which the sensor counts, of which a range is a round number.
    """
    index = np.flatnonzero(np.isfinite(position))
    values = position[index]
    if values.size < 3:
        return None
    found = _one_turn(values) or _other_range(values, unit)
    return found and Wrap(found.period, index[found.places], found.certain)


def unwrapped(position: Array, period: float) -> Array:
    """Return a position (N,) made continuous that starts anew after every `period`, both in rad.

    A lone outlier does not shift what follows; it stays one.
    """
    finite = np.isfinite(position)
    values = position[finite]
    if values.size < 2:
        return position
    good = steady(values, period, period / 8)
    smooth = values.copy()
    smooth[good] = np.unwrap(values[good], period=period)
    before = np.maximum.accumulate(np.where(good, np.arange(values.size), 0))
    smooth[~good] += (smooth - values)[before[~good]]
    result = position.copy()
    result[finite] = smooth
    return result


def steady(values: Array, period: float, least: float) -> Mask:
    """Tell which samples are no lone outliers: those that leave and come back at once.

    Parameters
    ----------
    values:
        (N,), finite.
    period:
        Range after which they start anew, infinite if they do not.
    least:
        Steps there and back up to which a sample is none.

    Returns
    -------
    NDArray[np.bool_]
        (N,)
    """
    steps = _nearest(np.diff(values), period)
    size = np.minimum(np.abs(steps[1:]), np.abs(steps[:-1]))
    left = np.abs(_nearest(steps[1:] + steps[:-1], period))
    lone = np.concatenate(([False], (size > least) & (left < size / 2), [False]))
    lone[1:-1] &= ~lone[2:] & ~lone[:-2]
    return ~lone


def least_step(steps: Array) -> float:
    """Return the smallest of steps (N,) that are not 0, as of one count; 0 if there is none."""
    return float(np.min(np.abs(steps[steps != 0]))) if np.any(steps) else 0.0


def _nearest(steps: Array, period: float) -> Array:
    """Return steps (N,) less the whole periods in them."""
    return steps - period * np.round(steps / period) if np.isfinite(period) else steps


def _one_turn(values: Array) -> Wrap | None:
    """Find wraps of a turn; a move from one end to the other and back is none."""
    index = np.flatnonzero(steady(values, TURN, TURN / 8))
    inside = values[index]
    steps = np.diff(inside)
    if _span(inside) > TURN * (1 + ROUNDED) or np.max(np.abs(steps)) < WHOLE * TURN:
        return None
    jumps = np.abs(steps) > TURN / 2
    moves = _nearest(steps, TURN)
    beside = np.pad(moves, 1, mode='edge')
    unlike = np.abs(moves - (beside[2:] + beside[:-2]) / 2)[jumps]
    slack = max(float(np.median(np.abs(moves[jumps]))) / 2, 1.5 * least_step(steps[~jumps]))
    if np.median(unlike) > max(slack, SMALL * TURN):
        return None
    return Wrap(TURN, index[:-1][jumps], True)


def _other_range(values: Array, unit: float) -> Wrap | None:
    """Find wraps of another range, by jumps that are all of its size and against the motion."""
    index = np.flatnonzero(steady(values, np.inf, SLOW * float(np.ptp(values))))
    inside = values[index]
    span, steps = _span(inside), np.diff(inside)
    jumps = np.abs(steps) > span / 2
    if not np.any(jumps) or np.all(jumps):
        return None
    usual = float(np.quantile(np.abs(steps[~jumps]), 0.99))
    telling = _against_motion(steps, jumps)
    if telling.size == 0 or usual > SLOW * span:
        return None
    sizes = min((_sizes(inside, telling, n) for n in range(1, NEIGHBOURS + 1)), key=np.std)
    period = float(np.median(sizes))
    slack = min(usual, period / 20)
    agreeing = np.abs(np.abs(steps[jumps]) - period) < 1.5 * usual
    same = np.abs(sizes - period) < slack
    if (
        np.mean(agreeing) < AGREEING
        or np.mean(same) < AGREEING
        or telling.size < TELLING * np.sum(jumps)
        or span > period + slack
    ):
        return None
    error = 3 * float(np.std(sizes[same])) / np.sqrt(np.sum(same)) + 1e-4 * period
    error += least_step(steps) / 2
    period = _roundest(float(np.mean(sizes[same])), error, unit)
    one_way = np.all(steps[telling] > 0) or np.all(steps[telling] < 0)
    return Wrap(period, index[:-1][jumps], telling.size >= (ONE_WAY if one_way else CERTAIN))


def _span(values: Array) -> float:
    """Return the length of the range that holds all values but a few outliers."""
    ordered, spared = np.sort(values), 1 + values.size // SPARED
    return float(np.min(ordered[-1 - spared :] - ordered[: spared + 1]))


def _against_motion(steps: Array, jumps: Mask) -> NDArray[np.intp]:
    """Return which steps are jumps against the motion right before and right after them."""
    found = []
    moves = np.where(jumps, np.nan, steps)
    for k in np.flatnonzero(jumps):
        sides = moves[max(k - NEIGHBOURS, 0) : k], moves[k + 1 : k + 1 + NEIGHBOURS]
        if all(
            side.size == NEIGHBOURS and np.all(side * steps[k] <= 0) and np.any(side)
            for side in sides
        ):
            found.append(k)
    return np.array(found, dtype=np.intp)


def _sizes(values: Array, places: NDArray[np.intp], reach: int) -> Array:
    """Return by how much (M,) parallel lines through `reach` steps before and after differ."""
    near = np.arange(reach + 1)
    before, after = values[places[:, None] - near], values[places[:, None] + 1 + near]
    slope = (before[:, 0] - before[:, -1] + after[:, -1] - after[:, 0]) / (2 * reach)
    between = np.mean(after, axis=1) - np.mean(before, axis=1)
    return np.asarray(np.abs(between - (reach + 1) * slope))


def _roundest(value: float, error: float, unit: float) -> float:
    """Return a number of half turns, a power of two or of few digits (in units) near a value."""
    turns, power = round(2 * value / TURN) / 2 * TURN, 2 ** round(np.log2(value / unit)) * unit
    few = [float(f'{value / unit:.{digits}g}') * unit for digits in range(1, 7)]
    return next((x for x in (turns, power, *few) if x > 0 and abs(x - value) <= error), value)
