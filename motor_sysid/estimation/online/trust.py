"""How much to believe each measurement and the filter itself, learned from the innovations.

Noise is read from the change of the innovation from sample to sample, so that a wrong model, whose
innovations change slowly, is not taken for noise.  A lone jump is a spike and counts little; a
second one in a row is believed.  Innovations that stay too large or keep their sign say that the
filter trusts itself too much.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept

Array = NDArray[np.float64]

_PATIENCE, _SHARE = 20.0, 0.2
_LONGEST = 3000.0
_SPIKE = 16.0
_TALLEST = 9.0
_MOMENT = 50.0
_LARGE = 1.5
_BIAS = 12.0

_NOISE, _LAST, _POWER, _MEAN, _COUNT, _SUSPECT, _QUANTUM, _BEFORE = range(8)


class Trust:
    """What is known of the noise of some channels.

    Parameters
    ----------
    channels:
        How many.

    Attributes
    ----------
    table:
        (8, channels) what `see` and `judge` take and change.
    """

    def __init__(self, channels: int) -> None:
        self.table = np.zeros((8, channels))
        self.table[_POWER] = 1.0
        self.table[_QUANTUM] = np.inf
        self.table[_BEFORE] = np.nan

    @property
    def variance(self) -> Array:
        """Noise variance of each channel."""
        return np.asarray(self.table[_NOISE])

    def guess(self, variance: Array) -> None:
        """Set the noise of channels that were never measured yet."""
        fresh = self.table[_COUNT] == 0
        self.table[_NOISE, fresh] = variance[fresh]

    def forget_last(self) -> None:
        """Compare the next sample with none before it."""
        self.table[_BEFORE] = np.nan
        self.table[_SUSPECT] = 0.0


@kept(error_model='numpy')
def see(table, values):  # type: ignore[no-untyped-def]
    """Note the smallest change of each channel (n_y,): noise is not less than rounding."""
    for j in range(values.size):
        change = abs(values[j] - table[_BEFORE, j])
        if 1e-9 * abs(values[j]) < change < table[_QUANTUM, j]:
            table[_QUANTUM, j] = change
        table[_BEFORE, j] = values[j]


@kept(error_model='numpy')
def judge(table, rows, innovation, spread):  # type: ignore[no-untyped-def]
    """Learn from an innovation.

    Parameters
    ----------
    table:
        What is known so far, (8, channels).
    rows:
        (k,) channels.
    innovation, spread:
        (k,) measured minus predicted, and (k, k) its variance without noise.

    Returns
    -------
    noise, spike, doubt:
        (k,) noise variances, larger for spikes; (k,) which are spikes; whether the filter
        trusts itself too much.
    """
    noise, spike, doubt = np.empty(rows.size), np.zeros(rows.size, dtype=np.bool_), False
    for k in range(rows.size):
        row, value = rows[k], innovation[k]
        floor = table[_QUANTUM, row] ** 2 / 12 if table[_QUANTUM, row] < np.inf else 0.0
        variance = max(table[_NOISE, row], floor)
        total = spread[k, k] + variance
        half = 0.5 * (value - table[_LAST, row]) ** 2
        excess = half / total / _SPIKE
        if excess > 1 and table[_SUSPECT, row] == 0.0:
            table[_SUSPECT, row] = 1.0
            spike[k] = True
            noise[k] = excess * total - spread[k, k]
            continue
        table[_SUSPECT, row] = 0.0
        noise[k] = variance
        table[_LAST, row] = value
        table[_COUNT, row] += 1
        weight = 1.0 / min(max(_SHARE * table[_COUNT, row], _PATIENCE), _LONGEST)
        table[_NOISE, row] = variance + weight * (min(half, _TALLEST * variance) - variance)
        power = min(value * value / total, _TALLEST * max(table[_POWER, row], 1.0))
        table[_POWER, row] += (power - table[_POWER, row]) / _MOMENT
        step = min(max(value / np.sqrt(total), -3.0), 3.0)
        table[_MEAN, row] += (step - table[_MEAN, row]) / _MOMENT
        biased = 2 * _MOMENT * table[_MEAN, row] ** 2 > _BIAS
        doubt = doubt or biased or table[_POWER, row] > _LARGE
    return noise, spike, doubt
