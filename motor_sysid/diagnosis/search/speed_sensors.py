"""What kind of speed sensor records may come from: of the moment or a mean, filtered or not."""

from collections.abc import Sequence

import numpy as np

from motor_sysid.physics.model import SpeedSensor
from motor_sysid.signals.lateness import Lateness
from motor_sysid.signals.record import Record

PROMPT, SURELY = 0.2, 4.0
"""Share of a sample by which a speed of the moment may seem late, and standard errors to add."""

MEAN, FILTERED = 0.6, 0.75
"""Samples by which a speed is late at most that is no more than a mean over one, and from which on
there is a filter."""

INEXACT = 1.05
"""How much longer or shorter than told a time constant may be: not all filters are of first order.
"""


def speed_sensors(
    records: Sequence[Record], outputs: Sequence[str], late: Lateness | None
) -> tuple[SpeedSensor, ...]:
    """Return the kinds of speed sensor that are worth trying.

    Beside a position there is but one, if the speed is its difference, or if it is not `late`:
    half a sample of an input delay would pass for the other.
    """
    if 'speed' not in outputs:
        return (SpeedSensor.IDEAL,)
    for record in records:
        if 'position' in record and len(record) > 10:
            backward = np.diff(record['position']) / np.diff(record.time)
            speed = record['speed'][1:]
            if np.std(backward - speed) < 0.05 * np.std(np.diff(speed)) + 1e-9 * np.std(speed):
                return (SpeedSensor.DIFFERENCE,)
    if late and abs(late.seconds) + SURELY * late.sigma < PROMPT * records[0].dt:
        return (SpeedSensor.IDEAL,)
    return (SpeedSensor.IDEAL, SpeedSensor.DIFFERENCE)


def is_filtered(late: Lateness | None, dt: float) -> bool | None:
    """Tell whether a speed sampled every `dt` s is filtered; None where nothing tells."""
    if late is None:
        return None
    margin = SURELY * late.sigma
    if late.seconds - margin > FILTERED * dt:
        return True
    return False if abs(late.seconds) + margin < MEAN * dt else None


def filter_box(late: Lateness | None, dt: float) -> tuple[float, float]:
    """Return the shortest and longest time constant, s, that a filter of the speed may have.

    One that takes the speed sample by sample is late by up to half a sample less than that.
    """
    if not is_filtered(late, dt) or late is None:
        return 0.0, np.inf
    margin = SURELY * late.sigma
    least = (late.seconds - margin) / INEXACT - 0.5 * dt
    return max(least, 0.1 * dt), INEXACT * (late.seconds + margin) + 0.5 * dt
