"""The signal names that a record may have, with their SI units and their role."""

from dataclasses import dataclass
from enum import Enum


class Role(Enum):
    """What a signal is to the motor, which decides how it is carried between two samples."""

    INPUT = 'input'
    """Drives the motor; held from one sample to the next, averaged over a coarser step."""
    STEPPED = 'stepped'
    """A reference or a code; held, never averaged."""
    MEASURED = 'measured'
    """Sampled at an instant; interpolated linearly."""


@dataclass(frozen=True)
class Channel:
    """One canonical signal: its name, the SI units it may have (the first is the usual one)."""

    name: str
    units: tuple[str, ...]
    role: Role


CHANNELS = (
    Channel('voltage', ('V',), Role.INPUT),
    Channel('duty', ('1',), Role.INPUT),
    Channel('supply_voltage', ('V',), Role.MEASURED),
    Channel('current', ('A',), Role.MEASURED),
    Channel('speed', ('rad/s', 'm/s'), Role.MEASURED),
    Channel('position', ('rad', 'm'), Role.MEASURED),
    Channel('acceleration', ('rad/s^2', 'm/s^2'), Role.MEASURED),
    Channel('torque', ('N m',), Role.INPUT),
    Channel('force', ('N',), Role.INPUT),
    Channel('temperature', ('degC',), Role.MEASURED),
    Channel('voltage_command', ('V',), Role.INPUT),
    Channel('current_command', ('A',), Role.STEPPED),
    Channel('speed_reference', ('rad/s', 'm/s'), Role.STEPPED),
    Channel('position_reference', ('rad', 'm'), Role.STEPPED),
    *(Channel(f'voltage_{axis}', ('V',), Role.INPUT) for axis in 'abcdq'),
    *(Channel(f'current_{axis}', ('A',), Role.MEASURED) for axis in 'abcdq'),
    Channel('hall_sector', ('1',), Role.STEPPED),
)
DRIVING_CURRENTS = ('current_q', 'current')
"""Take the place of an input where there is none (a current-controlled axis)."""
SLOW = frozenset({'temperature', 'supply_voltage', 'hall_sector'})
"""Signals that may be constant or in coarse steps without harm."""
BY_NAME = {channel.name: channel for channel in CHANNELS}


def role_of(name: str) -> Role:
    """Return the role of a signal; a name that is not canonical counts as measured."""
    channel = BY_NAME.get(name)
    return channel.role if channel else Role.MEASURED
