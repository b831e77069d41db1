"""Is the motor inside its limits?  Judged on what the topics say, sample by sample."""

from dataclasses import dataclass
import math

import numpy as np

from motor_sysid.nodes.angles import Angles
from motor_sysid.recording.sources import Source

SILENCE = 'nothing was heard of'


@dataclass(frozen=True)
class Bounds:
    """Limits of a running experiment; infinite where there is none.

    Attributes
    ----------
    speed, current, travel:
        Largest speed and current either way, rad/s (m/s) and A, and largest distance from where
        the experiment began, rad (m).
    timeout:
        Longest silence of a topic whose limit is watched, s.
    """

    speed: float = math.inf
    current: float = math.inf
    travel: float = math.inf
    timeout: float = 0.5


class Watch:
    """Watches one run of an experiment.

    Parameters
    ----------
    bounds:
        What must not be passed.
    now:
        Time of the start, s of any clock.
    """

    def __init__(self, bounds: Bounds, now: float) -> None:
        self._bounds = bounds
        self._angles = Angles([Source('position', unit='rad')])
        self._continuous(math.nan, begins=True)
        self._origin: float | None = None
        self._heard = {'speed': now, 'current': now, 'travel': now}

    def _continuous(self, position: float, *, begins: bool = False) -> float:
        """Return a position that its sensor may show within one turn, without its jumps."""
        values = np.array([[position]])
        self._angles.unwrap(values, np.array([begins]))
        return float(values[0, 0])

    def moved(self, now: float, speed: float, position: float) -> str:
        """Take a sample of the axis, NaN where missing; say what is wrong, or nothing."""
        if math.isfinite(position):
            self._heard['travel'] = now
            position = self._continuous(position)
            self._origin = position if self._origin is None else self._origin
            way = abs(position - self._origin)
            if way > self._bounds.travel:
                return passed('travel', way, self._bounds.travel, 'from the start')
        if math.isfinite(speed):
            self._heard['speed'] = now
            if abs(speed) > self._bounds.speed:
                return passed('speed', speed, self._bounds.speed)
        return ''

    def flowed(self, now: float, current: float) -> str:
        """Take a sample of the current; say what is wrong, or nothing."""
        if not math.isfinite(current):
            return ''
        self._heard['current'] = now
        if abs(current) > self._bounds.current:
            return passed('current', current, self._bounds.current)
        return ''

    def silent(self, now: float) -> str:
        """Say what has not been heard of for too long although it has a limit, or nothing."""
        for name, last in self._heard.items():
            if math.isfinite(getattr(self._bounds, name)) and now - last > self._bounds.timeout:
                return f'{SILENCE} the measured {name} for {now - last:.2g} s: it has a limit'
        return ''


def passed(name: str, value: float, limit: float, more: str = '') -> str:
    """Return the words for a limit that was passed."""
    return ' '.join(filter(None, (f'{name} {value:.4g} is beyond its limit {limit:.4g}', more)))
