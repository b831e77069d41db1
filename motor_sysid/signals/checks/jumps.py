"""Jumps of the position that no motion explains."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.checks.common import Array, is_angular
from motor_sysid.signals.checks.plausibility import SAME, slope_of
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.record import Record
from motor_sysid.signals.wrapping import find_wrap, least_step, steady

Places = NDArray[np.intp]

FAR = 3.0
"""Times the largest step that the speed makes anywhere, from which a step is a jump."""
STRAY = 5.0
"""Times the usual difference between a step and its speed that is reckoned with beside it."""
LONE = 3.0
"""Times the steps around it that a jump is larger than; a fast motion has others like it."""
OUTLYING = 3.0
"""Times the usual steps from which a sample that comes back at once is an outlier."""


@dataclass(frozen=True)
class Jumps:
    """Where a position jumps: the samples before, and the range that explains it, 0 if none."""

    record: Record
    places: Places
    period: float


def check(records: Sequence[Record]) -> Iterator[Finding]:
    """Look for jumps of the position that no motion explains."""
    found = [_jumps(record) for record in records if 'position' in record and len(record) > 10]
    count = sum(jumps.places.size for jumps in found)
    if count == 0:
        return
    most = max(found, key=lambda jumps: jumps.places.size)
    position, unit = most.record['position'], most.record.units['position']
    first = most.places[0]
    sizes = np.abs(np.diff(position)[most.places])
    why, remedy = '', 'look for a sensor that was reset or disturbed, and cut the record there'
    if most.period:
        why = f'; its sensor seems to start anew every {most.period:.6g} rad'
        remedy = (
            f'write `wrap: {most.period:.6g}` in a msg_config file, converted to the unit of its '
            'source before a gear (a whole number of counts, say); for a record made by hand '
            'there is `motor_sysid.signals.wrapping.unwrapped`'
        )
    yield Finding(
        Severity.WARNING, 'position_jumps',
        f'position jumps {"once" if count == 1 else f"{count} times"}, by up to '
        f'{np.max(sizes):.4g} {unit}, first from {position[first]:.6g} to '
        f'{position[first + 1]:.6g} at {most.record.time[first]:.6g} s, which no motion '
        f'explains{why}',
        'without a speed the model is fitted to the jumps; what depends on the position is wrong',
        remedy, {'jumps': count, f'largest_{unit}': float(np.max(sizes))},
    )  # fmt: skip


def _jumps(record: Record) -> Jumps:
    """Find the jumps of one record; against its speed where there is one that fits."""
    position = record['position']
    wrap = find_wrap(position) if is_angular(record) else None
    places = _against_speed(record) if 'speed' in record else None
    if places is None:
        places = wrap.places if wrap else _outliers(position)
    seen = wrap is not None and np.mean(np.isin(wrap.places, places)) > 0.5
    return Jumps(record, places, wrap.period if wrap and seen else 0.0)


def _against_speed(record: Record) -> Places | None:
    """Return where the position steps much further than its speed; None if they do not fit."""
    slope = slope_of(record)
    if slope is None or abs(slope.ratio - 1) > SAME:
        return None
    steps = np.diff(record['position'])
    by_speed = (record['speed'][1:] + record['speed'][:-1]) / 2 * np.diff(record.time)
    off = np.abs(steps - by_speed)
    reach = max(np.max(np.abs(by_speed)), least_step(steps), STRAY * np.median(off))
    around = np.pad(np.abs(steps), 3)
    nearby = np.max([np.roll(around, k)[3:-3] for k in (-3, -2, 2, 3)], axis=0)
    return np.flatnonzero((off > FAR * reach) & (np.abs(steps) > LONE * nearby))


def _outliers(position: Array) -> Places:
    """Return the steps towards samples that leave, much further than usual, and come back."""
    steps = np.diff(position)
    size = np.abs(steps)
    lasting = np.min([size[:-2], size[1:-1], size[2:]], axis=0)  # there and back are but two
    usual = max(float(np.quantile(lasting, 0.99)), least_step(steps))
    return np.flatnonzero(~steady(position, np.inf, OUTLYING * usual)) - 1
