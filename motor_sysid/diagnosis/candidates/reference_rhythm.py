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

_WIDTH, LOBE = 1.5, 5.0
_FINER = 2


class Rhythms:
    """The lines in the spectra of recorded references.

    Parameters
    ----------
    records:
        Uniform records.
    """

    def __init__(self, records: Sequence[Record]) -> None:
        self._spectra = [
            [(record.dt * len(record), _spectrum(record[n])) for n in moving_references(record)]
            for record in records
        ]

    def has(self, frequency: float) -> bool:
        """Whether a reference of every record moves at a frequency in Hz, or at 1/2, 1/3 or 1/4.

        What comes at one rhythm while the references have others is no effect of the motion.
        """
        return all(
            any(
                _stands_out(power, frequency * duration / n)
                for duration, power in spectra
                for n in range(1, HARMONICS + 1)
            )
            for spectra in self._spectra
        )


def _spectrum(values: Array) -> Array:
    """Return the power of (N,) values, `_FINER` times as many lines as they tell apart."""
    size = values.size
    waves = np.fft.rfft((values - values.mean()) * np.hanning(size), _FINER * size)
    power: Array = np.abs(waves) ** 2
    return power


def _stands_out(power: Array, line: float) -> bool:
    """Whether a line stands out of its surroundings; `line` is its number in the record."""
    first = max(int(_FINER * (line - REACH)), round(_WIDTH * _FINER))
    near = np.arange(first, min(int(_FINER * (line + REACH)) + 2, power.size))
    away = np.abs(near / _FINER - line)
    at = away < _WIDTH
    if not at.any() or at.all():
        return False
    peak = float(np.max(power[near[at]]))
    tall = peak > LINE * np.median(power[near])
    return bool(tall and peak >= np.max(power[near[away < LOBE]]))
