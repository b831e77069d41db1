"""What drives a simulation: held inputs, and the position that laws see."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.physics.model import SpeedSensor
from motor_sysid.physics.motors.base import Motor
from motor_sysid.physics.motors.speed import top_speed
from motor_sysid.signals.lattice import count_of
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
_EMPTY = np.empty(0)

REACH = 100
"""Rows before its own that a part of a drive keeps, at most."""


@dataclass(frozen=True)
class Drive:
    """What drives a simulation.

    Attributes
    ----------
    inputs:
        (N, n_u) held inputs.
    dt, start:
        Sample time and time of the first sample, s.
    position:
        (N,) measured position that position-dependent laws see, with one value more if that at
        the end is known; or empty: then they see the simulated one.
    speed:
        Highest speed (rad/s) that the motor is known to reach; it decides on substeps.
    count:
        Width of a count of the measured position, rad; 0 where it has none.  Laws see the
        simulated position as far as it lies within the count: what a rotor that rests sees is not
        what the encoder shows, and the same for as long as it rests.  That is held within the
        count, and no prediction: where the position is an output, laws see the measured one, for
        effects would explain all of it, but for a motor that commutates to the sample.
    ahead:
        (N,) how far the position lies ahead, rad, if it is the sum of a speed and that speed is
        one of the moment; or empty.
    before:
        What came just before, if that is known: delays reach back to it, else to the first input.
    """

    inputs: Array
    dt: float
    start: float = 0.0
    position: Array = field(default_factory=lambda: _EMPTY)
    speed: float = 0.0
    count: float = 0.0
    ahead: Array = field(default_factory=lambda: _EMPTY)
    before: 'Drive | None' = None

    @classmethod
    def of(cls, record: Record, kind: Motor, *, follow_position: bool = True) -> 'Drive':
        """Return the drive of a uniformly sampled record.

        Laws that depend on position are given the measured position where there is one, or the
        sum of the measured speed: a simulated angle drifts, and the wave with it.  Time counts
        from the start of the recording.

        Raises
        ------
        UserError
            If the record lacks every set of inputs of the motor kind or is not uniform.
        """
        names = input_signals(record, kind)
        if not record.is_uniform:
            raise UserError('the record is not uniformly sampled; use record.uniform()')
        position, ahead, count = _EMPTY, _EMPTY, 0.0
        if follow_position and 'position' in record:
            position = record['position']
            count = count_of(position)
            if kind.jumps:  # its positions were moved, each to the middle of what it may mean
                count = record.steps.get('position', count)
        elif follow_position and 'speed' in record:
            speed = record['speed']
            position, ahead = np.cumsum(speed) * record.dt, 0.5 * record.dt * (speed[0] + speed)
        columns = np.ascontiguousarray(np.column_stack([record[name] for name in names]))
        if kind.prompt:
            columns = np.concatenate((columns[1:], columns[-1:]))
        fastest = top_speed(record) if kind.wave else 0.0
        return cls(columns, record.dt, record.lead, position, fastest, count, ahead)

    def part(self, first: int, last: int) -> 'Drive':
        """Return the drive of rows first to last (exclusive), with time and position as here."""
        past = self._rows(max(first - REACH, 0), first, None) if first > 0 else self.before
        return self._rows(first, last, past)

    def _rows(self, first: int, last: int, before: 'Drive | None') -> 'Drive':
        return replace(
            self,
            inputs=self.inputs[first:last],
            start=self.start + first * self.dt,
            position=self.position[first:last],
            ahead=self.ahead[first:last],
            before=before,
        )

    def from_nothing(self) -> 'Drive':
        """Return the drive with no input before it, if nothing tells what came before."""
        if self.before is not None:
            return self
        position, ahead = (np.repeat(v[:1], REACH) for v in (self.position, self.ahead))
        inputs, start = np.zeros((REACH, self.inputs.shape[1])), self.start - REACH * self.dt
        still = replace(self, inputs=inputs, start=start, position=position, ahead=ahead)
        return replace(self, before=still)

    def led_in(self) -> 'Drive':
        """Return the drive with what came before it in front."""
        past = self.before
        if past is None:
            return self
        inputs, position, ahead = (
            np.concatenate((getattr(past, name), getattr(self, name)))
            for name in ('inputs', 'position', 'ahead')
        )
        return replace(
            self, inputs=inputs, start=past.start, position=position, ahead=ahead, before=None
        )

    def told_by(self, sensor: SpeedSensor) -> 'Drive':
        """Return the drive with the position that the speed of such a sensor adds up to.

        The sum of differences is the position they were taken of; between speeds of the moment
        lies their mean.
        """
        if not self.ahead.size:
            return self
        late = sensor is SpeedSensor.DIFFERENCE
        return replace(self, position=self.position - (not late) * self.ahead, ahead=_EMPTY)


def input_signals(record: Record, kind: Motor) -> tuple[str, ...]:
    """Return the first set of input signals of the motor kind that the record has.

    Raises
    ------
    UserError
        If it has none.
    """
    for names in kind.inputs:
        if all(name in record for name in names):
            return names
    wanted = ' or '.join('+'.join(names) for names in kind.inputs)
    raise UserError(
        f'a {kind.title} needs {wanted} as input; the record has {", ".join(record)}. Name the '
        'column or topic in a msg_config file'
    )
