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


def speed_sensor_scale(
    sensors: Sensors, size: float, s: Situation, rng: np.random.Generator
) -> Sensors:
    """Tachometer whose gain is `size` too large or too small."""
    return replace(sensors, counts=0.0, speed_scale=1 + size * float(rng.choice([-1.0, 1.0])))


def speed_sensor_lag(
    sensors: Sensors, size: float, s: Situation, rng: np.random.Generator
) -> Sensors:
    """Low pass of 1 to 2, 2 to 5 or 5 to 20 ms at sizes 1, 3 and 10 %."""
    low, high = (1e-3, 2e-3) if size < 0.02 else (2e-3, 5e-3) if size < 0.06 else (5e-3, 20e-3)
    return replace(sensors, speed_filter=float(np.exp(rng.uniform(np.log(low), np.log(high)))))


HIDE_SENSOR: dict[str, HideSensor] = {
    one.__name__: one
    for one in (current_sensor_scale, speed_sensor_offset, speed_sensor_scale, speed_sensor_lag)
}
"""Key to the function that hides it."""
