"""Parts of the time step: what the sensors show at a sample.

A drive that filters a speed takes it sample by sample, be it the difference of encoder counts over
the last sample or the speed itself,

    y' = y + (1 - exp(-dt / lag)) (d - y).

That is not what a filter ahead of the samples makes of it, which also sees how the speed changes
within one.  (Astrom and Wittenmark, Computer-Controlled Systems, 1997, chapter 2.)
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.effect import Effect
from motor_sysid.physics.native import inlined, LANES
from motor_sysid.physics.vector import get, put, spread, WIDTH

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


@inlined
def share_of(p, filters, dt):  # type: ignore[no-untyped-def]
    """Return if there is a filter, and how much of each new difference passes it.

    `filters` (n_y, 2) holds for each output the state that shows what has passed, and the row of
    the time constant; negative ones without a filter.
    """
    found, share = False, spread(0.0)
    for y in range(filters.shape[0]):
        if filters[y, 0] >= 0:
            found, share = True, 1.0 - np.exp(-dt / (get(p, filters[y, 1] * LANES) + NOTHING))
    return found, share


@inlined
def show(  # type: ignore[no-untyped-def]
    p, x, previous, rate, state, differenced, bias, sensor, filters, share, sensed, out, at
):  # fmt: skip
    """Write the outputs of a sample to rows from `at` on; see `share_of` for filters."""
    for y in range(state.shape[0]):
        j, row = state[y] * WIDTH, at + y * LANES
        shown = get(x, j)
        if differenced[y]:
            shown = (shown - get(previous, j)) * rate
        shown = shown + get(p, bias[y] * LANES)
        passed = filters[y, 0] * WIDTH
        if passed >= 0:
            before = get(previous, passed)
            shown = before + share * (shown - before)
            put(x, passed, shown)
        elif sensed:
            shown = shown + get(p, sensor[y] * LANES)
        put(out, row, shown)


@inlined
def hold_shown(x, previous, filters):  # type: ignore[no-untyped-def]
    """Keep what has passed filters until the next sample: its way there means nothing."""
    for y in range(filters.shape[0]):
        if filters[y, 0] >= 0:
            put(x, filters[y, 0] * WIDTH, get(previous, filters[y, 0] * WIDTH))
