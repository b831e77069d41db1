"""Parts of the time step: what the sensors show at a sample.

A drive that filters a speed takes it sample by sample, be it the difference of encoder counts over
the last sample or the speed itself,

    y' = y + (1 - exp(-dt / lag)) (d - y).

That is not what a filter ahead of the samples makes of it, which also sees how the speed changes
within one.  (Astrom and Wittenmark, Computer-Controlled Systems, 1997, chapter 2.)
"""

from collections.abc import Mapping, Sequence
import math

from numba import njit
import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.effect import Effect
from motor_sysid.physics.native import LANES

NONE = -1, -1
"""Rows of the filter of an output that has none."""

NOTHING = 1e-7
"""Time constant (s) that is added to any, so that none is zero."""


def filter_of(sensor: str, effects: Sequence[Effect], row: Mapping[str, int]) -> tuple[int, int]:
    """Return the rows of own state and time constant of the filter of a sensor.

    `row` is that of every parameter; own states follow the parameters of their effect.
    """
    for one in effects:
        if one.card.filter and sensor in one.laws:
            own = [row[f'{one.key}.{p.name}'] for p in one.card.parameters]
            return max(own) + 1, row[f'{one.key}.{one.card.filter}']
    return NONE


def placed(
    filters: Sequence[tuple[int, int]], states: int, core: Sequence[int]
) -> NDArray[np.int64]:
    """Return (n_y, 2) filters, with the place of the own state in a core of `states` and more.

    `core` holds the rows of these further states.
    """
    places = [(-1 if own < 0 else states + core.index(own), lag) for own, lag in filters]
    return np.array(places, dtype=np.int64).reshape(-1, 2)


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def shares(wide, p, filters, dt, share):  # type: ignore[no-untyped-def]
    """Set how much of each new difference passes a filter; return if there is one.

    `filters` (n_y, 2) holds for each output the state that shows what has passed, and the row of
    the time constant; negative ones without a filter.
    """
    found = False
    for y in range(filters.shape[0]):
        if filters[y, 0] >= 0:
            found, row = True, filters[y, 1] * LANES
            for k in range(wide):
                share[k] = 1.0 - math.exp(-dt / (p[row + k] + NOTHING))
    return found


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def show(  # type: ignore[no-untyped-def]
    wide, p, x, previous, rate, state, differenced, bias, sensor, filters, share, sensed, out, at
):  # fmt: skip
    """Write the outputs (n_y, W) of the sample at row `at`; see `shares` for filters."""
    for y in range(out.shape[1]):
        j, add = state[y], bias[y] * LANES
        if differenced[y]:
            for k in range(wide):
                out[at, y, k] = (x[j, k] - previous[j, k]) * rate + p[add + k]
        else:
            for k in range(wide):
                out[at, y, k] = x[j, k] + p[add + k]
        passed = filters[y, 0]
        if passed >= 0:
            for k in range(wide):
                before = previous[passed, k]
                x[passed, k] = before + share[k] * (out[at, y, k] - before)
                out[at, y, k] = x[passed, k]
        elif sensed:
            row = sensor[y] * LANES
            for k in range(wide):
                out[at, y, k] += p[row + k]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def hold_shown(wide, x, previous, filters):  # type: ignore[no-untyped-def]
    """Keep what has passed filters until the next sample: its way there means nothing."""
    for y in range(filters.shape[0]):
        if filters[y, 0] >= 0:
            for k in range(wide):
                x[filters[y, 0], k] = previous[filters[y, 0], k]
