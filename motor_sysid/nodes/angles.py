"""Angles that their sensor shows within one turn, made continuous sample by sample.

`motor_sysid.signals.wrapping` looks at the whole of a bag; here what has come so far has to do.
So a range other than a turn must be given.  What comes out depends on the samples alone, not on
how they were bunched.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept
from motor_sysid.recording.sources import DIVIDED_BY_GEAR, Source
from motor_sysid.signals.units import TURN
from motor_sysid.signals.wrapping import ROUNDED

Array = NDArray[np.float64]

JUMP, NEXT_JUMP = 0.8, 0.5
"""Shares of a turn beyond which a jump is taken for one: the first time, and from then on."""
ROOM = 1 + ROUNDED
"""What stays within so many turns may be wrapped."""


class Angles:
    """Adds the turns that the sensors left out.

    Parameters
    ----------
    sources:
        Of the columns; looked at are those in rad, but for those that are said never to wrap.
    """

    def __init__(self, sources: Sequence[Source]) -> None:
        ranges = {k: s.given_range() for k, s in enumerate(sources) if s.si_unit() == 'rad'}
        ranges = {k: period for k, period in ranges.items() if period != 0}
        self._columns = np.array(list(ranges), dtype=np.int64)
        self._ranges = np.array([p or _turn(sources[k]) for k, p in ranges.items()], dtype=float)
        self._given = np.array([p is not None for p in ranges.values()], dtype=np.bool_)
        self._state = np.zeros((len(ranges), 5))

    def unwrap(self, values: Array, begins: NDArray[np.bool_]) -> None:
        """Make the angles among (K, columns) values in SI continuous, in place.

        Parameters
        ----------
        values:
            What the sensors showed, through the gear.
        begins:
            (K,): where samples begin anew, and all before is forgotten.
        """
        _unwrap(values, begins, self._columns, self._ranges, self._given, self._state)


def _turn(source: Source) -> float:
    """Return a turn of the sensor's shaft as the values have it."""
    divided = source.signal in DIVIDED_BY_GEAR
    return abs(TURN / source.gear_ratio if divided else TURN * source.gear_ratio)


@kept()
def _unwrap(values, begins, columns, ranges, given, state):  # type: ignore[no-untyped-def]
    """Do it; a column's state: last, least and largest value, turns, whether it ever jumped."""
    for k in range(values.shape[0]):
        for j in range(columns.size):
            if begins[k]:
                state[j] = np.array([np.nan, np.inf, -np.inf, 0.0, 0.0])
            x, turn = values[k, columns[j]], ranges[j]
            if not np.isfinite(x):
                continue
            step = x - state[j, 0]
            state[j, 0] = x
            state[j, 1], state[j, 2] = min(state[j, 1], x), max(state[j, 2], x)
            if not given[j] and state[j, 2] - state[j, 1] > ROOM * turn:
                state[j, 3] = 0.0
            elif abs(step) > (NEXT_JUMP if given[j] or state[j, 4] else JUMP) * turn:
                state[j, 3] -= np.sign(step)
                state[j, 4] = 1.0
            values[k, columns[j]] = x + state[j, 3] * turn
