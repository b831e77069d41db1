"""The motor kinds.  To add one: write its file and add its name to `_FILES`."""

from functools import cache
from importlib import import_module

from motor_sysid.errors import UserError
from motor_sysid.physics.motors.base import Motor
from motor_sysid.signals.units import did_you_mean

_FILES = (
    'brushed_dc', 'pmsm', 'bldc', 'bldc_six_step', 'pmsm_q', 'brushed_dc_reduced',
    'mechanical_axis', 'inverse_axis',
)  # fmt: skip


@cache
def motors() -> dict[str, Motor]:
    """Return every motor kind by its key."""
    found = (import_module(f'{__name__}.{name}').MOTOR for name in _FILES)
    return {motor.key: motor for motor in found}


def motor(key: str) -> Motor:
    """Return a motor kind.

    Raises
    ------
    UserError
        If there is none of that key.
    """
    try:
        return motors()[key]
    except KeyError:
        raise UserError(
            f'unknown motor `{key}`{did_you_mean(key, motors())}; known are {", ".join(motors())}'
        ) from None
