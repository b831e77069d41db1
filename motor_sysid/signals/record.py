"""A record: time and measured columns in SI units, with their provenance."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
import hashlib
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motor_sysid.errors import UserError
from motor_sysid.signals.channels import Role, role_of
from motor_sysid.signals.lattice import lattice

Array = NDArray[np.float64]

UNIFORM_JITTER = 0.02
"""Largest deviation of a step from the median step, relative, that still counts as uniform."""
BURSTS = 10.0
"""Times the median step from which the mean one tells the pace: samples stamped in bursts."""


@dataclass(frozen=True)
class Provenance:
    """Where a record came from.

    Attributes
    ----------
    source:
        File, bag or topic names, as given by the user.
    notes:
        What was done to the data on the way in (scaling, resampling, dropped rows), in order.
    """

    source: str = ''
    notes: tuple[str, ...] = ()

    def noting(self, note: str) -> 'Provenance':
        """Return a copy with one more note."""
        return replace(self, notes=(*self.notes, note))


@dataclass(frozen=True)
class Samples:
    """What a sensor measured at times of its own.

    Attributes
    ----------
    time:
        (M,) s, strictly increasing, on the clock of the record.
    values:
        (M,) in the unit of the signal.
    """

    time: Array
    values: Array

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        object.__setattr__(self, 'time', _frozen(self.time))
        object.__setattr__(self, 'values', _frozen(self.values))

    def around(self, first: float, last: float) -> 'Samples':
        """Return those from the last one up to `first` to the first one from `last` on (s)."""
        start = max(int(np.searchsorted(self.time, first, side='right')) - 1, 0)
        stop = int(np.searchsorted(self.time, last)) + 1
        return Samples(self.time[start:stop], self.values[start:stop])


@dataclass(frozen=True)
class Record:
    """Signals of one motor over one uninterrupted stretch of time.

    Attributes
    ----------
    time:
        (N,) s, finite and strictly increasing.
    signals:
        Canonical signal name to (N,) values in SI units.  Measured signals of row k are taken at
        ``time[k]``; an input of row k acts from ``time[k]`` to ``time[k + 1]`` (zero-order hold).
    units:
        Signal name to its SI unit; a linear axis has m, m/s and N where a motor has rad, rad/s
        and N m.
    provenance:
        Where the record came from.
    steps:
        Quantized signal to its step, of those that were interpolated or moved since; see
        `step_of`.
    samples:
        Measured signal to what its sensor measured, of those that were not measured at the times
        of the rows: what the rows show of them lies between these.
    lead:
        Time from the start of the recording to the first row, s: of a part of a record.

    Raises
    ------
    UserError
        If lengths differ, a unit is missing, or time does not strictly increase.
    """

    time: Array
    signals: Mapping[str, Array]
    units: Mapping[str, str]
    provenance: Provenance = field(default_factory=Provenance)
    steps: Mapping[str, float] = field(default_factory=dict)
    samples: Mapping[str, Samples] = field(default_factory=dict)
    lead: float = 0.0

    def __post_init__(self) -> None:
        """Freeze the arrays and refuse what is not a record."""
        object.__setattr__(self, 'time', _frozen(self.time))
        object.__setattr__(
            self, 'signals', {name: _frozen(values) for name, values in self.signals.items()}
        )
        if len(self.time) < 2:
            raise UserError(f'a record needs at least 2 samples, got {len(self.time)}')
        for name, values in self.signals.items():
            if values.shape != self.time.shape:
                raise UserError(f'`{name}` has {values.size} samples, time has {self.time.size}')
            if name not in self.units:
                raise UserError(f'`{name}` has no unit; give one SI unit per signal')
        steps = np.diff(self.time)
        if not np.all(steps > 0):
            k = int(np.argmin(steps > 0))
            raise UserError(
                f'time must strictly increase: {self.time[k]:.9g} s is followed by '
                f'{self.time[k + 1]:.9g} s at sample {k + 1}; sort or split the record'
            )

    def __len__(self) -> int:
        """Return the number of samples."""
        return int(self.time.size)

    def __contains__(self, name: object) -> bool:
        """Tell whether the record has that signal."""
        return name in self.signals

    def __iter__(self) -> Iterator[str]:
        """Iterate over the signal names."""
        return iter(self.signals)

    def __getitem__(self, name: str) -> Array:
        """Return the (N,) values of a signal."""
        try:
            return self.signals[name]
        except KeyError:
            raise UserError(
                f'the record has no signal `{name}`; it has {", ".join(self.signals) or "none"}'
            ) from None

    @property
    def dt(self) -> float:
        """Median sample time in s; the mean one where samples came in bursts."""
        steps = np.diff(self.time)
        usual, mean = float(np.median(steps)), float(np.mean(steps))
        return mean if mean > BURSTS * usual else usual

    @property
    def duration(self) -> float:
        """Time from the first to the last sample in s."""
        return float(self.time[-1] - self.time[0])

    @property
    def clock(self) -> Array:
        """(N,) time since the recording began, s: what laws see."""
        clock: Array = self.lead + (self.time - self.time[0])
        return clock

    @property
    def is_uniform(self) -> bool:
        """Whether every step is within 2 % of the median step."""
        return bool(np.all(np.abs(np.diff(self.time) - self.dt) <= UNIFORM_JITTER * self.dt))

    def slice(self, start: int, stop: int) -> 'Record':
        """Return rows start to stop (exclusive)."""
        time = self.time[start:stop]
        return replace(
            self,
            time=time,
            signals={name: values[start:stop] for name, values in self.signals.items()},
            samples={
                name: own.around(time[0], time[-1])
                for name, own in self.samples.items()
                if time.size
            },
            lead=float(self.clock[start]) if time.size else self.lead,
        )

    def between(self, start: float, stop: float) -> 'Record':
        """Return the samples with ``start <= time < stop`` (s)."""
        first, last = np.searchsorted(self.time, [start, stop])
        return self.slice(int(first), int(last))

    def select(self, names: Iterable[str]) -> 'Record':
        """Return a record with only the named signals."""
        kept = tuple(names)
        return replace(
            self,
            signals={name: self[name] for name in kept},
            units={name: self.units[name] for name in kept},
            samples={name: own for name, own in self.samples.items() if name in kept},
        )

    def with_signal(self, name: str, values: ArrayLike, unit: str) -> 'Record':
        """Return a record with one signal more (or replaced)."""
        return replace(
            self,
            signals={**self.signals, name: np.asarray(values, dtype=np.float64)},
            units={**self.units, name: unit},
            steps={other: step for other, step in self.steps.items() if other != name},
            samples={other: own for other, own in self.samples.items() if other != name},
        )

    def shifted(self, name: str, by: float) -> 'Record':
        """Return a record with so much added to a signal, its own samples with it."""
        new = self.with_signal(name, self[name] + by, self.units[name])
        own = {
            other: Samples(one.time, one.values + by) if other == name else one
            for other, one in self.samples.items()
        }
        return replace(new, steps=self.steps, samples=own)

    def step_of(self, name: str) -> float:
        """Return the step of a signal as it was recorded, in its unit; 0 if it has none."""
        found = lattice(self[name])
        return self.steps.get(name) or (found.step if found else 0.0)

    def uniform(self, dt: float | None = None) -> 'Record':
        """Return the record on a uniform grid of step `dt` (s; default: the median step).

        Measured signals are interpolated linearly; inputs keep their mean over each new step, so
        that a zero-order hold stays one; references and codes are held.  A record that is uniform
        already is returned as it is.
        """
        pace = self.dt if dt is None else dt
        if self.is_uniform and abs(pace - self.dt) <= UNIFORM_JITTER * pace:
            return self
        count = int(np.floor(self.duration / pace * (1 + 1e-9))) + 1
        grid = self.time[0] + pace * np.arange(count)
        edges = np.append(grid, grid[-1] + pace)
        signals = {}
        for name, values in self.signals.items():
            own = self.samples.get(name, Samples(self.time, values))
            signals[name] = resample(name, own.time, own.values, edges)
        return replace(
            self,
            time=grid,
            signals=signals,
            steps={name: step for name in self if (step := self.step_of(name))},
            provenance=self.provenance.noting(f'resampled to {pace:.6g} s'),
        )

    def segments(self, max_gap: float) -> 'list[Record]':
        """Split where two samples are more than `max_gap` s apart; stubs under 2 samples go.

        Each part is a recording of its own: what was there before the gap is not known.
        """
        cuts = np.flatnonzero(np.diff(self.time) > max_gap) + 1
        edges = [0, *cuts.tolist(), len(self)]
        parts = [self.slice(a, b) for a, b in pairwise(edges) if b - a >= 2]
        return [replace(part, lead=0.0) for part in parts]

    def split(self, validation_fraction: float = 0.2) -> 'tuple[Record, Record]':
        """Return the first part for training and the last `validation_fraction` to validate."""
        if not 0 < validation_fraction < 1:
            raise UserError(f'validation fraction {validation_fraction} is not between 0 and 1')
        cut = round(len(self) * (1 - validation_fraction))
        return self.slice(0, cut), self.slice(cut, len(self))

    def digest(self) -> str:
        """Return the SHA-256 of time, names, units, values and samples, hexadecimal."""
        sha = hashlib.sha256(self.time.tobytes())
        for name in sorted(self.signals):
            sha.update(f'{name} [{self.units[name]}]'.encode())
            sha.update(self.signals[name].tobytes())
            if name in self.samples:
                sha.update(self.samples[name].time.tobytes())
                sha.update(self.samples[name].values.tobytes())
        return sha.hexdigest()


def _frozen(values: ArrayLike) -> Array:
    array: Array = np.ascontiguousarray(values, dtype=np.float64)
    if array.flags.writeable:
        array = array.copy()
        array.flags.writeable = False
    return array


def resample(name: str, time: Array, values: Array, edges: Array) -> Array:
    """Carry a signal to the rows that start at ``edges[:-1]`` and end at ``edges[1:]``.

    Parameters
    ----------
    name:
        Its canonical name, which decides its role: measured signals are interpolated linearly,
        references and codes held, and inputs averaged over each row as a zero-order hold; a row
        within which the input does not change gets that value exactly.
    time, values:
        (N,) s and (N,) any unit; before the first and after the last time the end value is held.
    edges:
        (M + 1,) s, increasing.

    Returns
    -------
    Array
        (M,) values.
    """
    if role_of(name) is Role.MEASURED:
        return np.asarray(np.interp(edges[:-1], time, values), dtype=np.float64)
    first = np.clip(np.searchsorted(time, edges[:-1], side='right') - 1, 0, None)
    if role_of(name) is Role.STEPPED:
        return np.asarray(values[first], dtype=np.float64)
    last = np.clip(np.searchsorted(time, edges[1:], side='left') - 1, first, None)
    return np.where(first == last, values[first], _held_mean(time, values, edges))


def _held_mean(time: Array, values: Array, edges: Array) -> Array:
    """Mean between successive `edges` of `values` held from each time to the next."""
    area = np.concatenate(([0.0], np.cumsum(values[:-1] * np.diff(time))))
    index = np.clip(np.searchsorted(time, edges, side='right') - 1, 0, None)
    total = area[index] + values[index] * (edges - time[index])
    return np.asarray(np.diff(total) / np.diff(edges), dtype=np.float64)
