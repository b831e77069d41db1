"""What drives a simulation: held inputs, and the position that laws see."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.physics.motors.base import Motor
from motor_sysid.physics.motors.speed import top_speed
from motor_sysid.signals.lattice import lattice
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
_EMPTY = np.empty(0)


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
        what the encoder shows, and the same for as long as it rests.
    """

    inputs: Array
    dt: float
    start: float = 0.0
    position: Array = field(default_factory=lambda: _EMPTY)
    speed: float = 0.0
    count: float = 0.0

    @classmethod
    def of(cls, record: Record, kind: Motor, *, follow_position: bool = True) -> 'Drive':
        """Return the drive of a uniformly sampled record.

        Laws that depend on position are given the measured position where there is one, or the
        sum of the measured speed: a simulated angle drifts, and the wave with it.

        Raises
        ------
        UserError
            If the record lacks every set of inputs of the motor kind or is not uniform.
        """
        names = input_signals(record, kind)
        if not record.is_uniform:
            raise UserError('the record is not uniformly sampled; use record.uniform()')
        position, count = _EMPTY, 0.0
        if follow_position and 'position' in record:
            position = record['position']
            steps = lattice(np.diff(position))
            count = steps.step if steps else 0.0
        elif follow_position and 'speed' in record:
            position = np.cumsum(record['speed']) * record.dt
        columns = np.ascontiguousarray(np.column_stack([record[name] for name in names]))
        if kind.prompt:
            columns = np.concatenate((columns[1:], columns[-1:]))
        speed = top_speed(record) if kind.wave else 0.0
        return cls(columns, record.dt, float(record.time[0]), position, speed, count)


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
