"""The speed of a record, measured or differenced from the position."""

import numpy as np

from motor_sysid.errors import UserError
from motor_sysid.physics.motors.base import Array
from motor_sysid.signals.record import Record


def measured_speed(record: Record) -> Array:
    """Return (N,) speed in rad/s or m/s; central differences of the position if need be.

    Raises
    ------
    UserError
        If the record has neither speed nor position.
    """
    if 'speed' in record:
        return record['speed']
    if 'position' in record:
        speed: Array = np.gradient(record['position'], record.time)
        return speed
    raise UserError('the record has neither speed nor position; a motor needs one of them')


def top_speed(record: Record) -> float:
    """Return the highest speed in rad/s or m/s, short spikes left out; 0 if there is none."""
    if 'speed' not in record and 'position' not in record:
        return 0.0
    return float(np.quantile(np.abs(measured_speed(record)), 0.999))
