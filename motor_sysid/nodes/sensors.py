"""The sensors of a small drive: an incremental encoder and a current converter."""

from collections.abc import Mapping
from dataclasses import dataclass
import math

import numpy as np


@dataclass(frozen=True)
class SensorSettings:
    """Properties of the sensors.

    Attributes
    ----------
    counts_per_revolution:
        Encoder counts of one turn; 0 for an ideal position.
    current_noise, current_offset:
        Standard deviation and constant error in A.
    current_range, current_bits:
        The converter covers -range to +range (A) with 2**bits codes; 0 bits for an ideal one.
    seed:
        Of the noise.
    """

    counts_per_revolution: int = 4096
    current_noise: float = 0.02
    current_offset: float = 0.0
    current_range: float = 20.0
    current_bits: int = 12
    seed: int = 0


class DriveSensors:
    """What a drive reports: position in whole counts, speed as their difference, current codes.

    Parameters
    ----------
    settings:
        Properties of the sensors.
    dt:
        Sample time in s.
    """

    def __init__(self, settings: SensorSettings, dt: float) -> None:
        self._settings, self._dt = settings, dt
        self._rng = np.random.default_rng(settings.seed)
        self.reset(0.0)

    def reset(self, position: float) -> None:
        """Start again with the shaft at `position` (rad)."""
        self._position = self.counted(position)

    def motion(
        self, shown: Mapping[str, float], state: Mapping[str, float]
    ) -> tuple[float, float]:
        """Return measured speed (rad/s) and position (rad); asked once in a sample.

        What a motor's `shown` speed has beside that of its `state` (the gain, offset or lag of a
        sensor) is added to the difference of the counts.
        """
        speed, position = self._encoder(shown['position'])
        return speed + shown['speed'] - state['omega'], position

    def _encoder(self, position: float) -> tuple[float, float]:
        """Return speed (rad/s) and position (rad) as counted.

        The speed is the difference of the position over the last sample, as drives compute it:
        half a sample late, and in steps of one count per sample.
        """
        counted = self.counted(position)
        speed = (counted - self._position) / self._dt
        self._position = counted
        return speed, counted

    def phases(self, a: float, b: float) -> tuple[float, float, float]:
        """Return measured phase currents (A).

        Two sensors, in a and b, have the offset, b that of the other sign; c is the rest.
        """
        s = self._settings
        shown_a, shown_b = self.current(a), self.current(b - 2 * s.current_offset)
        return shown_a, shown_b, -shown_a - shown_b

    def counted(self, position: float) -> float:
        """Return the position as the encoder shows it, rad."""
        counts = self._settings.counts_per_revolution
        if not counts:
            return position
        step = 2 * math.pi / counts
        return math.floor(position / step) * step

    def current(self, current: float) -> float:
        """Return a measured current (A)."""
        s = self._settings
        value = current + s.current_offset + s.current_noise * self._rng.standard_normal()
        if not s.current_bits:
            return float(value)
        step = 2 * s.current_range / 2**s.current_bits
        top = 2 ** (s.current_bits - 1)
        return float(min(max(round(value / step), -top), top - 1) * step)
