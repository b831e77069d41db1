"""Angles that their sensor shows within one turn, made continuous sample by sample.

`motor_sysid.recording.sources.unwrapped` looks at the whole of a bag; here what has come so far
has to do.  What comes out depends on the samples alone, not on how they were bunched.
"""

from collections.abc import Sequence

from numba import njit
import numpy as np
from numpy.typing import NDArray

from motor_sysid.recording.sources import DIVIDED_BY_GEAR, Source
from motor_sysid.signals.units import TURN

Array = NDArray[np.float64]

JUMP, NEXT_JUMP = 0.8, 0.5
"""Shares of a turn beyond which a jump is taken for one: the first time, and from then on."""
ROOM = 1 + 1e-6
"""What stays within so many turns may be wrapped."""


class Angles:
    """Adds the turns that the sensors left out.

    Parameters
    ----------
    sources:
        Of the columns; those in rad are looked at.
    """

    def __init__(self, sources: Sequence[Source]) -> None:
        columns = [k for k, source in enumerate(sources) if source.si_unit() == 'rad']
        self._columns = np.array(columns, dtype=np.int64)
        self._turns = np.array([_turn(sources[k]) for k in columns], dtype=np.float64)
        self._state = np.zeros((len(columns), 5))

    def unwrap(self, values: Array, begins: NDArray[np.bool_]) -> None:
        """Make the angles among (K, columns) values in SI continuous, in place.

        Parameters
        ----------
        values:
            What the sensors showed, through the gear.
        begins:
            (K,): where samples begin anew, and all before is forgotten.
        """
        _unwrap(values, begins, self._columns, self._turns, self._state)


def _turn(source: Source) -> float:
    """Return a turn of the sensor's shaft as the values have it."""
    divided = source.signal in DIVIDED_BY_GEAR
    return abs(TURN / source.gear_ratio if divided else TURN * source.gear_ratio)


@njit(cache=True)
def _unwrap(values, begins, columns, turns, state):  # type: ignore[no-untyped-def]
    """Do it; a column's state: last, least and largest value, turns, whether it ever jumped."""
    for k in range(values.shape[0]):
        for j in range(columns.size):
            if begins[k]:
                state[j] = np.array([np.nan, np.inf, -np.inf, 0.0, 0.0])
            x, turn = values[k, columns[j]], turns[j]
            if not np.isfinite(x):
                continue
            step = x - state[j, 0]
            state[j, 0] = x
            state[j, 1], state[j, 2] = min(state[j, 1], x), max(state[j, 2], x)
            if state[j, 2] - state[j, 1] > ROOM * turn:
                state[j, 3] = 0.0
            elif abs(step) > (NEXT_JUMP if state[j, 4] else JUMP) * turn:
                state[j, 3] -= np.sign(step)
                state[j, 4] = 1.0
            values[k, columns[j]] = x + state[j, 3] * turn
