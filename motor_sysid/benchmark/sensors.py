"""From what happened to what is recorded: encoder, tachometer, current sensor."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from motor_sysid.benchmark.truth import Truth
from motor_sysid.signals.record import Provenance, Record

Array = NDArray[np.float64]

_UNITS = {
    'voltage': 'V', 'current': 'A', 'speed': 'rad/s', 'position': 'rad',
    'speed_reference': 'rad/s',
}  # fmt: skip


@dataclass(frozen=True)
class Sensors:
    """How the motor is measured.

    Attributes
    ----------
    counts:
        Encoder counts per turn; 0: a tachometer, and no position.
    tacho_noise:
        Noise of the tachometer, rad/s.
    current_noise, current_step, current_offset, current_scale:
        Noise and resolution of the current sensor and its offset, A, and its gain, 1.
    position:
        Whether the position is recorded.
    speed_offset, speed_scale:
        What a tachometer shows at standstill, rad/s, and its gain, 1; counts have neither.
    speed_filter:
        Time constant of the low pass through which the drive gives the speed, s; 0: none.
    """

    counts: float
    tacho_noise: float
    current_noise: float
    current_step: float
    current_offset: float
    current_scale: float = 1.0
    position: bool = True
    speed_offset: float = 0.0
    speed_scale: float = 1.0
    speed_filter: float = 0.0


def clean(truth: Truth, sensors: Sensors, dt: float) -> dict[str, Array]:
    """Return signal to (N,) values as sensors without noise and resolution would show them."""
    speed = sensors.speed_scale * truth.speed + sensors.speed_offset
    if sensors.counts:
        speed = np.diff(truth.position, prepend=truth.position[:1]) / dt
    speed = _filtered(speed, sensors, dt)
    signals = {
        'current': sensors.current_scale * truth.shown_current + sensors.current_offset,
        'speed': speed,
    }
    if sensors.counts and sensors.position:
        signals['position'] = truth.position
    return signals


def measure(
    truth: Truth,
    sensors: Sensors,
    dt: float,
    rng: np.random.Generator,
    reference: Array | None = None,
) -> Record:
    """Return the record of a run.

    Parameters
    ----------
    reference:
        (N,) rad/s, if a controller followed one.
    """
    signals = {'voltage': truth.voltage, **clean(truth, sensors, dt)}
    count = truth.voltage.size
    noisy = signals['current'] + sensors.current_noise * rng.standard_normal(count)
    signals['current'] = sensors.current_step * np.round(noisy / sensors.current_step)
    if sensors.counts:
        step = 2 * np.pi / sensors.counts
        angle = step * np.floor(truth.position / step)
        signals['speed'] = _filtered(np.diff(angle, prepend=angle[:1]) / dt, sensors, dt)
        if sensors.position:
            signals['position'] = angle
    else:
        signals['speed'] = signals['speed'] + sensors.tacho_noise * rng.standard_normal(count)
    if reference is not None:
        signals['speed_reference'] = reference
    units = {name: _UNITS[name] for name in signals}
    time = dt * np.arange(count, dtype=np.float64)
    return Record(time, signals, units, Provenance('benchmark'))


def _filtered(speed: Array, sensors: Sensors, dt: float) -> Array:
    """Return (N,) speed behind the drive's low pass, which begins at the first value."""
    if sensors.speed_filter == 0.0:
        return speed
    share = 1 - np.exp(-dt / sensors.speed_filter)
    passed: Array = lfilter([share], [1, share - 1], speed, zi=[(1 - share) * speed[0]])[0]
    return passed
