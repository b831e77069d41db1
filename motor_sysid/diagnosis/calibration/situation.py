"""What a calibration is keyed to: motor kind, sensors, and the class of the excitation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.methods.reference import REFERENCES
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.speed import measured_speed
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

_SLOW = 0.05
_LITTLE, _MUCH = 0.05, 0.35


@dataclass(frozen=True)
class Situation:
    """The class of a motor on its bench; few and coarse, so that a new record finds its own.

    Attributes
    ----------
    motor:
        Motor kind.
    outputs:
        Signals that errors are taken of.
    speed_sensor:
        ``ideal`` or ``difference``.
    sample_time, samples:
        Sample time in s and samples of all training records, rounded to half a decade.
    loop:
        ``closed`` where a reference was recorded, else ``open``.
    reversals:
        Whether the motor turns both ways.
    slow:
        ``little``, ``some`` or ``much`` time near standstill.
    shape:
        ``levels`` where what leads the motion is mostly constant, else ``sweep``.
    """

    motor: str
    outputs: tuple[str, ...]
    speed_sensor: str
    sample_time: float
    samples: float
    loop: str
    reversals: bool
    slow: str
    shape: str


def situation_of(
    model: Model, records: Sequence[Record], outputs: Sequence[str]
) -> Situation:
    """Return the class of training records that a model was fitted to."""
    evens = [r.uniform() for r in records]
    speed = np.concatenate([measured_speed(r) for r in evens])
    top = float(np.max(np.abs(speed))) or 1.0
    slow = float(np.mean(np.abs(speed) < _SLOW * top))
    leads = [_leading(model, r) for r in evens]
    still = float(np.mean(np.concatenate([np.diff(v) == 0.0 for v in leads])))
    return Situation(
        motor=model.motor,
        outputs=tuple(outputs),
        speed_sensor=model.speed_sensor.value,
        sample_time=_coarse(float(np.median([r.dt for r in evens]))),
        samples=_coarse(float(sum(len(r) for r in evens))),
        loop='closed' if all(_reference(r) for r in evens) else 'open',
        reversals=bool(np.max(speed) > _SLOW * top and np.min(speed) < -_SLOW * top),
        slow='little' if slow < _LITTLE else 'much' if slow > _MUCH else 'some',
        shape='levels' if still > 0.5 else 'sweep',
    )


def _reference(record: Record) -> str:
    return next((name for name in REFERENCES if name in record), '')


def _leading(model: Model, record: Record) -> Array:
    """Return (N,) what leads the motion: the reference, or else the input."""
    name = _reference(record) or input_signals(record, model.kind)[0]
    return record[name]


def _coarse(value: float) -> float:
    """Round to half a decade: 1, 3.2, 10 ..."""
    return float(f'{10 ** (round(2 * np.log10(value)) / 2):.2g}')
