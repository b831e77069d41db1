"""What a motor is made to do over time: parts in a row, each with a simple shape.

There is one kind of profile: what the controller, the simulator, `motor-sysid suggest` and the
node `excitation` know is a `Profile`, whether its parts are built in, designed or read from a file
(`motor_sysid.control.profile_file`).
"""

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
import math
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError

Array = NDArray[np.float64]

SPEED = 'speed_reference'
"""Signal of a profile that a speed controller follows; any other drives the motor itself."""


class Shape(Protocol):
    """A curve: shares of a part's time (0 to 1) to shares of the profile's level, (N,) each."""

    key: ClassVar[str]

    def __call__(self, x: Array) -> Array:
        """Return the values at shares of the time."""


@dataclass(frozen=True)
class Hold:
    """A constant level."""

    key: ClassVar[str] = 'hold'
    level: float

    def __call__(self, x: Array) -> Array:
        """Return the level."""
        return np.full_like(x, self.level)


@dataclass(frozen=True)
class Ramp:
    """A straight line."""

    key: ClassVar[str] = 'ramp'
    start: float
    stop: float

    def __call__(self, x: Array) -> Array:
        """Return the values on the line."""
        return self.start + (self.stop - self.start) * x


@dataclass(frozen=True)
class Triangle:
    """A line up to the level, down to its negative, and back to zero."""

    key: ClassVar[str] = 'triangle'
    level: float

    def __call__(self, x: Array) -> Array:
        """Return the values on the three lines."""
        return self.level * (2 / math.pi) * np.asarray(np.arcsin(np.sin(2 * math.pi * x)))


@dataclass(frozen=True)
class Sweep:
    """A sine that goes from `first` to `last` turns per part, growing evenly."""

    key: ClassVar[str] = 'sweep'
    level: float
    first: float
    last: float

    def __call__(self, x: Array) -> Array:
        """Return the values of the sine."""
        turns = x * (self.first + 0.5 * (self.last - self.first) * x)
        return self.level * np.asarray(np.sin(2 * math.pi * turns))


SHAPES: dict[str, type[Hold] | type[Ramp] | type[Triangle] | type[Sweep]] = {
    shape.key: shape for shape in (Hold, Ramp, Triangle, Sweep)
}
"""Every shape by the name that it has in files."""


@dataclass(frozen=True)
class Part:
    """One part of a profile: its share of the duration and its shape."""

    share: float
    shape: Hold | Ramp | Triangle | Sweep


def holds(share: float, levels: Iterable[float]) -> tuple[Part, ...]:
    """Return constant levels that last equally long."""
    return tuple(Part(share, Hold(level)) for level in levels)


REST = Part(0.5, Hold(0.0))
STEPS = holds(0.6, (0.4, -0.4, 0.8, -0.2, 0.6, -0.9, 0.15, -0.6, 1.0, -0.1))
RAMPS = (Part(3.0, Triangle(1.0)), Part(3.0, Triangle(0.35)))
CRAWL = (Part(2.0, Triangle(0.08)), *holds(0.7, (0.05, -0.05)))
SWEEP = (Part(3.0, Sweep(0.5, 1.0, 14.0)),)
BACK = holds(0.6, (0.5, -0.3, 0.2, -0.4))
LAST = (*BACK, Part(1.5, Triangle(0.3)), Part(1.0, Triangle(0.1)))
"""A smaller mixture: the part that is held back to validate."""

PROFILES: dict[str, tuple[Part, ...]] = {
    'mixed': (REST, *STEPS, *RAMPS, *CRAWL, *SWEEP, *STEPS[::-2], *LAST, REST),
    'steps': (REST, *STEPS, REST),
    'reversals': (REST, *BACK, REST),
    'ramps': (REST, *RAMPS, *CRAWL, REST),
    'sweep': (REST, *SWEEP, REST),
}
"""Every built-in profile by name; shares are relative."""


@dataclass(frozen=True)
class Profile:
    """A signal over time; zero before its start and after its end.

    Attributes
    ----------
    name:
        One of `PROFILES`, or any name where parts are given.
    level:
        What a shape's 1 means, in `unit`: the largest speed or voltage.
    duration:
        Of the whole profile, s.
    parts:
        Its parts; by default those of `PROFILES`.
    signal, unit:
        What is to follow it: ``speed_reference`` for a speed controller, or the input of the motor
        (``voltage``, ``torque``, ``force``, ``current``).

    Raises
    ------
    UserError
        If there is no such profile, or the level or the duration makes no sense.
    """

    name: str
    level: float
    duration: float
    parts: tuple[Part, ...] = field(default=(), repr=False)
    signal: str = SPEED
    unit: str = 'rad/s'

    def __post_init__(self) -> None:
        """Look the parts up and refuse what cannot be run."""
        if not self.parts:
            if self.name not in PROFILES:
                raise UserError(f'no profile `{self.name}`; there are {", ".join(PROFILES)}')
            object.__setattr__(self, 'parts', PROFILES[self.name])
        if not (math.isfinite(self.duration) and self.duration > 0):
            raise UserError(f'profile duration {self.duration:g} s must be positive')
        if not math.isfinite(self.level):
            raise UserError(f'profile level {self.level:g} {self.unit} must be finite')
        if not all(math.isfinite(p.share) and p.share > 0 for p in self.parts):
            raise UserError('every part of a profile must last longer than 0 s')

    @cached_property
    def edges(self) -> tuple[float, ...]:
        """Start of every part, then the end, s."""
        whole = sum(part.share for part in self.parts)
        starts = [0.0]
        for part in self.parts:
            starts.append(starts[-1] + part.share / whole * self.duration)
        return tuple(starts)

    def __call__(self, t: float) -> float:
        """Return the value in `unit` at `t` s after the start."""
        if not 0 <= t < self.duration:
            return 0.0
        k = min(bisect_right(self.edges, t), len(self.parts)) - 1
        return float(self._within(k, np.array([t]))[0])

    def sampled(self, dt: float) -> Array:
        """Return (N,) values at 0, dt, 2 dt, ... up to the end of the profile."""
        time = dt * np.arange(max(math.ceil(self.duration / dt - 1e-9), 2))
        places = np.searchsorted(time, self.edges[1:-1])
        pieces = np.split(time, places)
        return np.concatenate([self._within(k, piece) for k, piece in enumerate(pieces)])

    def _within(self, k: int, times: Array) -> Array:
        """Return the values of part k at times within it."""
        start, stop = self.edges[k], self.edges[k + 1]
        return self.level * self.parts[k].shape((times - start) / (stop - start))
