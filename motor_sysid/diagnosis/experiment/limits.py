"""What an experiment must not exceed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
import math

import numpy as np

from motor_sysid.errors import UserError
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.motors.base import Motor
from motor_sysid.physics.motors.speed import measured_speed
from motor_sysid.signals.record import Record

MARGIN = 0.9
"""Share of each limit that a simulated experiment may use: models err, and sensors are noisy."""

LONGEST = 10.0
"""Time of an experiment where the user sets no limit, s."""

UNITS = {
    'input': 'V (N m, N or A)', 'speed': 'rad/s (m/s)', 'current': 'A', 'travel': 'rad (m)',
    'time': 's',
}  # fmt: skip
"""What limits are in."""


@dataclass(frozen=True)
class Limits:
    """Limits of an experiment; infinite where there is none.

    Attributes
    ----------
    input:
        Largest input either way: V (N m, N or A for a motor driven by these).
    speed:
        Largest speed either way, rad/s (m/s).
    current:
        Largest current either way, A.
    travel:
        Largest distance from the start, either way, rad (m).
    time:
        Longest experiment, s.
    reverse:
        Whether the motor may turn back.

    Raises
    ------
    UserError
        If a limit is not positive.
    """

    input: float = math.inf
    speed: float = math.inf
    current: float = math.inf
    travel: float = math.inf
    time: float = LONGEST
    reverse: bool = True

    def __post_init__(self) -> None:
        """Refuse limits that allow nothing."""
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name != 'reverse' and not value > 0:
                unit = UNITS[item.name]
                raise UserError(f'the limit of {item.name} is {value:g} {unit}; give more than 0')
        if not math.isfinite(self.time):
            raise UserError('an experiment needs an end; give the limit of time in s')

    def of(self, name: str) -> float:
        """Return one of the limits of size: input, speed, current, travel."""
        return float(getattr(self, name))

    def widened(self, name: str) -> 'Limits':
        """Return the limits with one of them doubled, or turning back allowed."""
        if name == 'reverse':
            return replace(self, reverse=True)
        fresh: dict[str, float] = {name: 2 * float(getattr(self, name))}
        return Limits(**{**self.sizes(), 'time': self.time, **fresh}, reverse=self.reverse)

    def sizes(self) -> dict[str, float]:
        """Return the limits of size by name."""
        return {name: self.of(name) for name in SIZES}


SIZES = ('input', 'speed', 'current', 'travel')


def limits_of(records: Sequence[Record], kind: Motor, **given: float | bool | None) -> Limits:
    """Return limits: what is given, and otherwise what the motor has done in the records.

    A rotary axis may turn as far as it likes; a linear one, half of the recorded range either way
    from where it starts.

    Raises
    ------
    UserError
        If a limit is not positive or has an unknown name.
    """
    unknown = set(given) - {item.name for item in fields(Limits)}
    if unknown:
        raise UserError(f'no limit `{sorted(unknown)[0]}`; there are {", ".join(SIZES)}, time')
    name = input_signals(records[0], kind)[0]
    done = {
        'input': _largest([r[name] for r in records]),
        'speed': _largest([measured_speed(r) for r in records]),
    }
    if all('current' in r for r in records):
        done['current'] = _largest([r['current'] for r in records])
    if all('position' in r and r.units['position'] == 'm' for r in records):
        done['travel'] = 0.5 * max(float(np.ptp(r['position'])) for r in records)
    chosen = {key: value / MARGIN for key, value in done.items() if value > 0}
    wanted: Mapping[str, float | bool] = {k: v for k, v in given.items() if v is not None}
    reverse = bool(wanted.get('reverse', True))
    numbers = {k: float(v) for k, v in {**chosen, **wanted}.items() if k != 'reverse'}
    return Limits(**numbers, reverse=reverse)


def _largest(columns: Sequence[np.ndarray]) -> float:
    """Return what is exceeded in one sample of a thousand only: a spike of noise sets no limit."""
    return float(np.quantile(np.abs(np.concatenate(columns)), 0.999))
