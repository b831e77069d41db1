"""When an output was sampled that is not new in every row, and what of a run it shows then."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from motor_sysid.physics.motors.base import Motor
from motor_sysid.signals.record import Record, Samples
from motor_sysid.signals.slow_updates import news_of, shown_in

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

MEAN = 0.05
"""Share of the changes of a speed up to which it is the difference of its position's samples."""
_DECIMALS = 6
"""Of a time in rows: what lies in a row but for the rounding of its time lies there."""


@dataclass(frozen=True)
class Settling:
    """How an output goes from row to row: straight, but for what steps of the input left to do.

    Attributes
    ----------
    rates:
        (P,) 1/row, how fast it settles by itself.
    away:
        (N, P) how far it is from where it would go straight; empty if it always does.
    """

    rates: Array
    away: Array


STRAIGHT = Settling(np.zeros(0), np.zeros((0, 0)))


@dataclass(frozen=True)
class Linear:
    """A linear motor much like a model: what tells how outputs go between rows.

    Attributes
    ----------
    rates:
        (n_y, P) 1/s, how fast each output settles by itself.
    gains:
        (n_y, n_u, P) where each settles with each input, alone.
    """

    rates: Array
    gains: Array

    def settling(self, output: int, inputs: Array, dt: float) -> Settling:
        """Return how an output goes from row to row under (N, n_u) held inputs."""
        rates, gains = dt * self.rates[output], self.gains[output]
        if inputs.shape[1] != len(gains) or not np.any(gains):
            return STRAIGHT
        kicks = -np.diff(inputs, axis=0, prepend=inputs[:1]) @ gains
        away = [lfilter([1.0], [1.0, -np.exp(-r)], k) for r, k in zip(rates, kicks.T, strict=True)]
        return Settling(rates, np.stack(away, axis=1))


def linear_of(kind: Motor, values: Mapping[str, Array], outputs: Sequence[str]) -> Linear:
    """Return the linear motor of parameters (P,) by name."""
    a, b, _ = kind.like(values)
    states = {output.signal: kind.states.index(output.state) for output in kind.outputs}
    rows = [states[name] for name in outputs]
    rates = np.stack([np.maximum(-a[:, k, k], 0.0) for k in rows])
    gains = np.stack([b[:, k].T for k in rows])
    settles = rates > 0
    over = np.where(settles, rates, 1.0)[:, np.newaxis]
    return Linear(rates, np.where(settles[:, np.newaxis], gains / over, 0.0))


@dataclass(frozen=True)
class Sampling:
    """When an output was sampled, in rows of a run and parts of rows.

    Attributes
    ----------
    times:
        (M,) when each sample was taken.
    shows:
        (N,) which of them each row shows.
    mean:
        Whether a sample is the mean since the one before, as the difference of positions is.
    """

    times: Array
    shows: Rows
    mean: bool = False

    @property
    def fresh(self) -> float:
        """Share of the rows in which it is new."""
        return min(self.times.size / self.shows.size, 1.0)

    @property
    def is_between(self) -> bool:
        """Whether any was taken between two rows."""
        return bool(np.any(self.times % 1.0))

    def of(self, run: Array, settling: 'Settling') -> Array:
        """Return what is shown of an (N, P) output of P simulations, (N, P)."""
        if not self.mean:
            return _between(run, self.times, settling)[self.shows]
        total, straight = np.cumsum(run, axis=0), STRAIGHT
        before = np.concatenate((self.times[:1], self.times[:-1]))
        length = (self.times - before)[:, np.newaxis]
        since = _between(total, self.times, straight) - _between(total, before, straight)
        means = since / np.where(length > 0, length, 1.0)
        return np.where(length > 0, means, _between(run, self.times, settling))[self.shows]

    def part(self, first: int, last: int) -> 'Sampling':
        """Return that of rows first to last (exclusive) of the run, as a run by itself.

        What was sampled before the first of them is taken for what it shows.
        """
        shows = self.shows[first:last]
        begin = max(int(shows[0]) - 1, 0)
        times = np.clip(self.times[begin : shows[-1] + 1] - first, 0.0, last - first - 1.0)
        return Sampling(times, shows - begin, self.mean)


def sampling_of(record: Record, name: str, period: int) -> Sampling | None:
    """Return when an output of an even record was sampled; None if in every row.

    Parameters
    ----------
    period:
        For how many rows it is held, of what the record does not know itself.
    """
    own = record.samples.get(name)
    if own is None:
        rows = news_of(record, name, period)
        if rows is None:
            return None
        own = Samples(record.time[rows], record[name][rows])
    times = np.round((own.time - record.time[0]) / record.dt, _DECIMALS)
    times = np.clip(times, 0.0, len(record) - 1.0)
    return Sampling(times, shown_in(record, own), name == 'speed' and _is_mean(own, record))


def _is_mean(speed: Samples, record: Record) -> bool:
    """Tell whether a speed is the difference of the positions at the times of its samples."""
    if 'position' not in record or speed.time.size < 3:
        return False
    position = record.samples.get('position', Samples(record.time, record['position']))
    change = np.diff(np.interp(speed.time, position.time, position.values))
    off = np.std(change / np.diff(speed.time) - speed.values[1:])
    return bool(off < MEAN * np.std(np.diff(speed.values)) + 1e-9 * np.std(speed.values))


def _between(values: Array, times: Array, settling: Settling) -> Array:
    """Return (M, P) of (N, P) values at M times in rows."""
    low = np.minimum(times.astype(np.intp), len(values) - 1)
    part = (times - low)[:, np.newaxis]
    found: Array = values[low]
    if not np.any(part):
        return found
    found = found + part * (values[np.minimum(low + 1, len(values) - 1)] - found)
    if not settling.away.size:
        return found
    left = np.exp(-settling.rates)
    bent = left**part - (1 - part) - part * left
    return np.asarray(found + bent * settling.away[low])
