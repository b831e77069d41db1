"""When an output was sampled that is not new in every row, and what of a run it shows then."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record, Samples
from motor_sysid.signals.slow_updates import news_of, shown_in

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

MEAN = 0.05
"""Share of the changes of a speed up to which it is the difference of its position's samples."""
_DECIMALS = 6
"""Of a time in rows: what lies in a row but for the rounding of its time lies there."""


@dataclass(frozen=True)
class Alone:
    """What an input makes of an output alone: each step of it fades in at the rate of its winding.

    What the motion does to that output is slow, and straight from row to row.

    Attributes
    ----------
    stays:
        (P,) what a row leaves of a difference.
    rows:
        (N, P) its values at the rows.
    older, newer:
        (N, P) where it goes before and after the input of a row arrives.
    arrives:
        (P,) when in the row that is, 0 to 1.
    """

    stays: Array
    rows: Array
    older: Array
    newer: Array
    arrives: Array

    @classmethod
    def of(cls, goes: Array, rates: Array, late: Array) -> 'Alone':
        """Return it for rates (P,) 1/row, where (N, P) inputs lead, (P,) rows late."""
        stays, whole = np.exp(-rates), np.floor(late).astype(np.intp)
        rows = np.arange(len(goes))[:, np.newaxis] - whole
        newer, older = (
            np.take_along_axis(goes, np.maximum(rows - back, 0), axis=0) for back in (0, 1)
        )
        arrives = late - whole
        left = stays ** (1.0 - arrives)
        comes = older * (left - stays) + newer * (1.0 - left)
        found = np.empty_like(goes)
        for p, stay in enumerate(stays):
            start = np.array([stay * older[0, p]])
            found[1:, p] = lfilter([1.0], [1.0, -stay], comes[:-1, p], zi=start)[0]
        found[0] = older[0]
        return cls(stays, found, older, newer, arrives)

    def at(self, low: Rows, part: Array) -> Array:
        """Return it (M, P) in rows `low`, (M, 1) parts of a row on."""
        left = self.stays**part
        since = self.stays ** np.maximum(part - self.arrives, 0.0)
        older, newer = self.older[low], self.newer[low]
        return np.asarray(
            left * self.rows[low] + older * (since - left) + newer * (1.0 - since)
        )


@dataclass(frozen=True)
class Linear:
    """A linear motor much like a model: what tells how outputs go between rows.

    Attributes
    ----------
    rates:
        (n_y, P) 1/s, how fast each output settles by itself.
    gains:
        (n_y, n_u, P) where each settles with each input, alone.
    late:
        (P,) s after which an input arrives.
    """

    rates: Array
    gains: Array
    late: Array

    def alone(self, output: int, inputs: Array, dt: float) -> Alone | None:
        """Return what (N, n_u) held inputs make of an output alone; None if that is not known."""
        gains = self.gains[output]
        if inputs.shape[1] != len(gains) or not np.any(gains):
            return None
        return Alone.of(inputs @ gains, dt * self.rates[output], self.late / dt)


def linear_of(model: Model, values: Mapping[str, Array], outputs: Sequence[str]) -> Linear:
    """Return the linear motor of a model with parameters (P,) by name."""
    kind = model.kind
    a, b, _ = kind.like(values)
    states = {output.signal: kind.states.index(output.state) for output in kind.outputs}
    rows = [states[name] for name in outputs]
    rates = np.stack([np.maximum(-a[:, k, k], 0.0) for k in rows])
    gains = np.stack([b[:, k].T for k in rows])
    settles = rates > 0
    over = np.where(settles, rates, 1.0)[:, np.newaxis]
    cards = [effect(key).card for key in model.effects]
    delays = [
        values[f'{key}.{card.delay}']
        for key, card in zip(model.effects, cards, strict=True) if card.delay
    ]  # fmt: skip
    late = np.zeros(rates.shape[1]) + sum(delays)
    return Linear(rates, np.where(settles[:, np.newaxis], gains / over, 0.0), late)


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

    def of(self, run: Array, alone: Alone | None) -> Array:
        """Return what is shown of an (N, P) output of P simulations, (N, P).

        `alone` is what the input makes of it alone.
        """
        if not self.mean:
            return _between(run, self.times, alone)[self.shows]
        total = np.cumsum(run, axis=0)
        before = np.concatenate((self.times[:1], self.times[:-1]))
        length = (self.times - before)[:, np.newaxis]
        since = _between(total, self.times) - _between(total, before)
        means = since / np.where(length > 0, length, 1.0)
        return np.where(length > 0, means, _between(run, self.times))[self.shows]

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


def _between(values: Array, times: Array, alone: Alone | None = None) -> Array:
    """Return (M, P) of (N, P) values at M times in rows.

    They are straight from row to row, but for what the input makes of them `alone`.
    """
    low = np.minimum(times.astype(np.intp), len(values) - 1)
    high = np.minimum(low + 1, len(values) - 1)
    part = (times - low)[:, np.newaxis]
    if not np.any(part):
        return np.asarray(values[low])
    if alone is None:
        return np.asarray(values[low] + part * (values[high] - values[low]))
    slow = values - alone.rows
    return np.asarray(slow[low] + part * (slow[high] - slow[low]) + alone.at(low, part))
