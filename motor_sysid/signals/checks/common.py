"""What several checks need: the input that drives the motor, and its speed."""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.channels import DRIVING_CURRENTS
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

INPUTS = ('voltage', 'voltage_q', 'duty', 'force', 'torque', 'voltage_command', 'voltage_a')
"""Signals that drive a motor, the most direct first."""
SUPPLY = (
    'the supply voltage that the duty cycle is a share of: a column `supply_voltage [V]`, or '
    '`supply_voltage: {constant: 24}` in a msg_config file'
)
"""What makes a duty cycle an input."""
OUTPUTS = ('speed', 'position', 'current', 'current_q', 'current_a')
"""Signals of which at least one must be measured."""


def main_input(record: Record) -> str:
    """Return the name of the signal that drives the motor, empty if there is none."""
    for name in (*INPUTS, *DRIVING_CURRENTS):
        if name in record:
            return name
    return ''


def main_current(record: Record) -> str:
    """Return the name of the measured current that makes torque, empty if there is none."""
    return next((name for name in ('current', 'current_q') if name in record), '')


def speed_of(record: Record) -> Array | None:
    """Return the speed, measured or as the smoothed slope of the position, else None: (N,)."""
    if 'speed' in record and (np.any(record['speed']) or 'position' not in record):
        return record['speed']
    if 'position' not in record or len(record) < 20:
        return None
    return smoothed(np.gradient(record['position'], record.time), 9)


def smoothed(values: Array, width: int) -> Array:
    """Return the moving mean of `values` over `width` samples, of the same length."""
    width = min(width, values.size)
    padded = np.concatenate((np.full(width // 2, values[0]), values, np.full(width, values[-1])))
    area = np.concatenate(([0.0], np.cumsum(padded)))
    return np.asarray((area[width:] - area[:-width])[: values.size] / width, dtype=np.float64)


def is_angular(record: Record) -> bool:
    """Tell whether the axis turns (and does not slide)."""
    return not {'m', 'm/s', 'N'} & set(record.units.values())
