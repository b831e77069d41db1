"""Hide an effect in the sensors: from its key and size to what they do wrong."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from motor_sysid.benchmark.hidden import Situation
from motor_sysid.benchmark.sensors import Sensors

HideSensor = Callable[[Sensors, float, Situation, np.random.Generator], Sensors]


def current_sensor_scale(
    sensors: Sensors, size: float, s: Situation, rng: np.random.Generator
) -> Sensors:
    """Gain that is `size` too large or too small."""
    return replace(sensors, current_scale=1 + size * float(rng.choice([-1.0, 1.0])))


def speed_sensor_offset(
    sensors: Sensors, size: float, s: Situation, rng: np.random.Generator
) -> Sensors:
    """Tachometer that shows `size` times the no-load speed at standstill (counts show none)."""
    offset = size * s.sheet.top_speed * float(rng.choice([-1.0, 1.0]))
    return replace(sensors, counts=0.0, speed_offset=offset)


HIDE_SENSOR: dict[str, HideSensor] = {
    one.__name__: one for one in (current_sensor_scale, speed_sensor_offset)
}
"""Key to the function that hides it."""
