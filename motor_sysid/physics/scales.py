"""Typical sizes of a motor's signals in its records: what boxes and starts are measured by."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np

from motor_sysid.physics.effect import Scale
from motor_sysid.physics.motors import motor
from motor_sysid.physics.motors.speed import measured_speed
from motor_sysid.signals.record import Record


@dataclass(frozen=True)
class Scales:
    """RMS of torque, speed, current, voltage; sample time and duration in s; loss in W.

    And the shortest and longest time constant that a filter of the speed may have, s, if known.
    """

    torque: float
    speed: float
    current: float
    voltage: float
    sample: float
    duration: float
    loss: float
    speed_filter: tuple[float, float] = (0.0, math.inf)

    def size(self, scale: Scale) -> float:
        """Return the size that a parameter of that scale is measured by."""
        return {
            Scale.ONE: 1.0,
            Scale.TORQUE: self.torque,
            Scale.DRAG: self.torque / self.speed**2,
            Scale.SPEED: self.speed,
            Scale.CURRENT: self.current,
            Scale.ANGLE: self.speed * self.sample,
            Scale.VOLTAGE: self.voltage,
            Scale.PER_VOLTAGE: 1.0 / self.voltage,
            Scale.SAG: 1.0 / (self.voltage * self.current),
            Scale.SAMPLE: self.sample,
            Scale.RATE: 1.0 / self.sample,
            Scale.DURATION: self.duration,
            Scale.DRIFT: self.torque / self.duration,
            Scale.VISCOUS_DRIFT: self.torque / (self.speed * self.duration),
            Scale.ROOT_SPEED: self.torque / math.sqrt(self.speed),
            Scale.HEATING: 1.0 / (self.loss * self.duration),
        }[scale]


def scales_of(key: str, values: dict[str, float], records: Sequence[Record]) -> Scales:
    """Measure the scales of a motor of kind `key` with parameter `values` in its records."""
    kind = motor(key)
    torque = np.concatenate([kind.drive_torque(values, record) for record in records])
    speed = np.concatenate([measured_speed(record) for record in records])
    current = _size(records, 'current', kind.frame)
    resistance = values.get('R', 1.0)
    return Scales(
        torque=_rms(torque),
        speed=_rms(speed),
        current=current,
        voltage=_size(records, 'voltage', kind.frame),
        sample=records[0].dt,
        duration=max(record.lead + record.duration for record in records),
        loss=max((1.5 if kind.frame else 1.0) * resistance * current**2, 1e-12),
    )


def _size(records: Sequence[Record], name: str, frame: str) -> float:
    """Return the RMS of a current or voltage; of three phases that of their amplitude."""
    if frame == 'dq':
        return math.hypot(*(_rms(_joined(records, f'{name}_{axis}')) for axis in frame))
    if frame == 'abc':
        a, b = (_joined(records, f'{name}_{phase}') for phase in 'ab')
        c = _joined(records, f'{name}_c') if name == 'voltage' else -a - b
        star = (a + b + c) / 3
        return math.sqrt(2) * _rms(np.concatenate([a - star, b - star, c - star]))
    shown = next((n for n in (name, f'{name}_q') if n in records[0]), name)
    return _rms(_joined(records, shown))


def _joined(records: Sequence[Record], name: str) -> np.ndarray:
    parts = [record[name] for record in records if name in record]
    return np.concatenate(parts) if parts else np.ones(1)


def _rms(values: np.ndarray) -> float:
    return max(float(np.sqrt(np.mean(values**2))), 1e-12)
