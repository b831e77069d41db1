"""Speed references that excite what a diagnosis needs: levels, reversals, slow motion, sweeps."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math

from motor_sysid.errors import UserError

Shape = Callable[[float], float]
"""Time since the start of a part as a share of it (0 to 1) to a share of the top speed."""


@dataclass(frozen=True)
class Part:
    """One part of a profile: its share of the duration and its shape."""

    share: float
    shape: Shape


def hold(level: float) -> Shape:
    """Return a constant level."""
    return lambda x: level


def ramp(start: float, stop: float) -> Shape:
    """Return a straight line."""
    return lambda x: start + (stop - start) * x


def triangle(level: float) -> Shape:
    """Return a line up to the level, down to its negative, and back to zero."""
    return lambda x: level * (2 / math.pi) * math.asin(math.sin(2 * math.pi * x))


def sweep(level: float, first: float, last: float) -> Shape:
    """Return a sine that goes from `first` to `last` turns per part, growing evenly."""
    return lambda x: level * math.sin(2 * math.pi * x * (first + 0.5 * (last - first) * x))


REST = Part(0.5, hold(0.0))
STEPS = tuple(
    Part(0.6, hold(level)) for level in (0.4, -0.4, 0.8, -0.2, 0.6, -0.9, 0.15, -0.6, 1.0, -0.1)
)
RAMPS = (Part(3.0, triangle(1.0)), Part(3.0, triangle(0.35)))
CRAWL = (Part(2.0, triangle(0.08)), Part(0.7, hold(0.05)), Part(0.7, hold(-0.05)))
SWEEP = (Part(3.0, sweep(0.5, 1.0, 14.0)),)
BACK = tuple(Part(0.6, hold(level)) for level in (0.5, -0.3, 0.2, -0.4))
LAST = (*BACK, Part(1.5, triangle(0.3)), Part(1.0, triangle(0.1)))
"""A smaller mixture: the part that is held back to validate."""

PROFILES: dict[str, tuple[Part, ...]] = {
    'mixed': (REST, *STEPS, *RAMPS, *CRAWL, *SWEEP, *STEPS[::-2], *LAST, REST),
    'steps': (REST, *STEPS, REST),
    'reversals': (REST, *BACK, REST),
    'ramps': (REST, *RAMPS, *CRAWL, REST),
    'sweep': (REST, *SWEEP, REST),
}
"""Every profile by name; shares are relative."""


class Profile:
    """A speed reference over time; zero before its start and after its end.

    Parameters
    ----------
    name:
        One of `PROFILES`.
    top_speed:
        Largest speed, rad/s.
    duration:
        Of the whole profile, s.

    Raises
    ------
    UserError
        If there is no such profile, or the duration is not positive.
    """

    def __init__(self, name: str, top_speed: float, duration: float) -> None:
        if name not in PROFILES:
            raise UserError(f'no profile `{name}`; there are {", ".join(PROFILES)}')
        if duration <= 0:
            raise UserError(f'profile duration {duration:g} s must be positive')
        self.duration, self._top = duration, top_speed
        self._parts: Sequence[Part] = PROFILES[name]
        whole = sum(part.share for part in self._parts)
        self._starts = [0.0]
        for part in self._parts:
            self._starts.append(self._starts[-1] + part.share / whole * duration)

    def __call__(self, t: float) -> float:
        """Return the reference in rad/s at `t` s after the start."""
        if not 0 <= t < self.duration:
            return 0.0
        k = min(bisect_right(self._starts, t), len(self._parts)) - 1
        start, stop = self._starts[k], self._starts[k + 1]
        return self._top * self._parts[k].shape((t - start) / (stop - start))
