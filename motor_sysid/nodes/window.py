"""The last samples of something, in a ring of fixed size."""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]


class Window:
    """The last samples, in a ring of fixed size; it begins anew where the stamps fall back.

    Parameters
    ----------
    capacity:
        Samples kept.
    width:
        Values of one sample.
    """

    def __init__(self, capacity: int, width: int) -> None:
        self._stamps = np.zeros(capacity, dtype=np.int64)
        self._values = np.zeros((capacity, width))
        self._taken = 0

    def __len__(self) -> int:
        """Return the number of samples held."""
        return min(self._taken, self._stamps.size)

    def append(self, stamps: Stamps, values: Array, good: NDArray[np.bool_]) -> None:
        """Add those of (K,) stamps and (K, width) values that are good (K,)."""
        self._taken = _append(self._stamps, self._values, self._taken, stamps, values, good)

    def clear(self) -> None:
        """Forget all samples."""
        self._taken = 0

    def last(self) -> tuple[Stamps, Array]:
        """Return the samples in order: (N,) stamps in ns, (N, width) values."""
        rows = (self._taken - len(self) + np.arange(len(self))) % self._stamps.size
        return self._stamps[rows], self._values[rows]


@kept()
def _append(ring_stamps, ring_values, taken, stamps, values, good):  # type: ignore[no-untyped-def]
    """Add good samples to the ring; return how many it was given since they began (anew)."""
    for k in range(stamps.size):
        if good[k]:
            if taken and stamps[k] <= ring_stamps[(taken - 1) % ring_stamps.size]:
                taken = 0
            row = taken % ring_stamps.size
            ring_stamps[row] = stamps[k]
            for j in range(values.shape[1]):
                ring_values[row, j] = values[k, j]
            taken += 1
    return taken
