"""Take lone spikes out of measured signals, one sample late."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
        clean = held.y.copy()
        for j, value in enumerate(held.y.tolist()):
            before, after = float(self._before[j]), float(sample.y[j])
            off = abs(value - 0.5 * (before + after))
            if not math.isfinite(off):
                continue
            typical = float(self._typical[j])
            if off > _FAR * typical > 0 and off > _ALONE * abs(after - before):
                clean[j] = 0.5 * (before + after)
            most = _TALLEST * typical if typical > 0 else off
            self._typical[j] = typical + (min(off, most) - typical) / _MOMENT
        self._before = clean
        return held._replace(y=clean)
