"""How much of a record is held back to judge on: its last part, if the motor moves there."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

DULL = 0.5
"""Share of its due (as much of the motion as of the time) below which a last part tells too little
to judge on."""

MOST_HELD = 0.5
"""Share of a record beyond which no more is held back."""


def kept(record: Record, fraction: float) -> float:
    """Return the share of a record, 0 to 1, that is fitted; the rest is held back.

    That is all but the last `fraction`, or less: where the motor hardly moves at the end of its
    record, every model is right there, and percents of that motion mean nothing.  What is held
    back then begins early enough to have its due of the way that the motor makes, up to
    `MOST_HELD` of the record or the `fraction` that was asked for, if that is more.
    """
    travel = _travel(record)
    asked = 1.0 - fraction
    if travel.size == 0 or travel[-1] == 0.0:
        return asked
    travel /= travel[-1]
    if 1.0 - travel[min(round(asked * travel.size), travel.size - 1)] >= DULL * fraction:
        return asked
    enough = float(np.searchsorted(travel, asked, side='right')) / travel.size
    return min(asked, max(enough, 1.0 - MOST_HELD))


def remarks_on_held(records: Sequence[Record], fraction: float) -> tuple[str, ...]:
    """Say of which records more is held back than was asked for, and why."""
    said = []
    for record in records:
        share = 1.0 - kept(record, fraction)
        if share > fraction + 1e-9:
            source = record.provenance.source
            said.append(
                f'{f"{source}: " if source else ""}the motor hardly moves in the last '
                f'{fraction:.0%} of the record: the last {share:.0%} are held back to judge on'
            )
    return tuple(said)


def _travel(record: Record) -> Array:
    """Return the way that the motor has made by each sample (N,), in any unit, or nothing."""
    if 'position' in record:
        steps = np.abs(np.diff(record['position'], prepend=record['position'][:1]))
    elif 'speed' in record:
        steps = np.abs(record['speed'])
    else:
        return np.empty(0)
    return np.asarray(np.cumsum(steps))
