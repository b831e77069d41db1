"""The rhythm of a reference: what comes at it may be an effect of the motion, not of time."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.methods.reference import moving_references
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

HARMONICS = 4
"""Waves in a period of the reference that what depends on the motion may have."""

LINE, REACH = 50.0, 20
"""Power of a line in units of the median of its surroundings, which reach so many lines (the
inverse of the record's length) to either side; noise has 50 once in 1e15."""

_WIDTH, _LOBE = 1.5, 5.0


def is_rhythm(records: Sequence[Record], frequency: float) -> bool:
    """Whether a reference moves at a frequency in Hz, or at a half, a third or a quarter of it."""
    return any(
        stands_out(record[name], frequency / n * record.dt)
        for record in records
        for name in moving_references(record)
        for n in range(1, HARMONICS + 1)
    )


def stands_out(values: Array, frequency: float) -> bool:
    """Whether a line of (N,) values stands out of its surroundings; `frequency` is per sample."""
    size = values.size
    near = frequency + np.arange(-REACH, REACH + 1) / size
    near = near[(near > _WIDTH / size) & (near < 0.5)]
    at = np.abs(near - frequency) * size < _WIDTH
    if not at.any() or at.all():
        return False
    waves = np.exp(-2j * np.pi * np.outer(near, np.arange(size)))
    power = np.abs(waves @ ((values - values.mean()) * np.hanning(size))) ** 2
    beside = np.abs(near - frequency) * size < _LOBE
    peak = float(np.max(power[at]))
    return bool(peak > LINE * np.median(power) and peak >= np.max(power[beside]))
