"""Take lone spikes out of measured signals, one sample late."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept

Array = NDArray[np.float64]

_FAR = 8.0
_ALONE = 3.0
_TALLEST = 4.0
_MOMENT = 200.0


class Sample(NamedTuple):
    """A sample.

    Attributes
    ----------
    time, length:
        Its start and length in s.
    u, y:
        (n_u,) held input, (n_y,) outputs at its end.
    before, after:
        (n,) states at its start and end, as far as they are known.
    """

    time: float
    length: float
    u: Array
    y: Array
    before: Array
    after: Array


class Despiker:
    """Replaces a value that lies far from both of its neighbours, which lie close together.

    Parameters
    ----------
    channels:
        Number of outputs.
    """

    def __init__(self, channels: int) -> None:
        self._typical = np.zeros(channels)
        self._before = np.full(channels, np.nan)
        self._held: Sample | None = None

    def restart(self, y: Array) -> None:
        """Begin after outputs `y` (n_y,)."""
        self._before, self._held = y.copy(), None

    def push(self, sample: Sample) -> Sample | None:
        """Take a sample; return the one before it, cleaned, if there is one."""
        held, self._held = self._held, sample
        if held is None:
            return None
        clean = _clean(held.y, self._before, sample.y, self._typical)
        self._before = clean
        return Sample(held.time, held.length, held.u, clean, held.before, held.after)


@kept()
def _clean(y, before, after, typical):  # type: ignore[no-untyped-def]
    """Return `y` (n_y,) without spikes; `typical` (n_y,) distances from neighbours are learned."""
    clean = y.copy()
    for j in range(y.size):
        middle = 0.5 * (before[j] + after[j])
        off = abs(y[j] - middle)
        if not math.isfinite(off):
            continue
        usual = typical[j]
        if off > _FAR * usual > 0 and off > _ALONE * abs(after[j] - before[j]):
            clean[j] = middle
        most = _TALLEST * usual if usual > 0 else off
        typical[j] = usual + (min(off, most) - usual) / _MOMENT
    return clean
