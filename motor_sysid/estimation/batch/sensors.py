"""What sensors make of outputs before they are recorded: where they end, how long they hold.

Several records of a motor have the same sensors: what one of them tells holds for all.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.sampling import Sampling, sampling_of
from motor_sysid.physics.motors.base import Motor
from motor_sysid.signals.flat_tops import common_limits, limits_of
from motor_sysid.signals.record import Record
from motor_sysid.signals.slow_updates import periods_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sensors:
    """What the records of a motor tell of its sensors.

    Attributes
    ----------
    limits:
        Smallest and largest value that the sensor of a current can show, infinite where no record
        shows it.  A speed or a position that stays where it is at most may be that of a motor at
        its end stop.
    periods:
        Samples for which measured signals are held, of those that are.
    """

    limits: Mapping[str, tuple[float, float]]
    periods: Mapping[str, int]

    def limits_of(self, record: Record, kind: Motor, outputs: Sequence[str]) -> Array | None:
        """Return (2, n_y) limits of outputs of a record; None if there are none.

        Where it does not show any itself, those of the other records.
        """
        currents, beyond = _measured_currents(kind), (-np.inf, np.inf)
        own = np.array([limits_of(record[n]) if n in currents else beyond for n in outputs]).T
        shared = np.array([self.limits.get(n, beyond) for n in outputs]).T
        limits = np.where(np.isfinite(own), own, shared)
        return limits if np.any(np.isfinite(limits)) else None

    def sampling_of(self, record: Record, outputs: Sequence[str]) -> tuple[Sampling | None, ...]:
        """Return when each output was sampled, of those that are not new in every row."""
        return tuple(sampling_of(record, name, self.periods.get(name, 1)) for name in outputs)


def sensors_of(records: Sequence[Record], kind: Motor) -> Sensors:
    """Return what uniform records of one motor tell of its sensors."""
    names = {name for record in records for name in _measured_currents(kind) & set(record)}
    limits = {name: common_limits([r[name] for r in records if name in r]) for name in names}
    return Sensors(limits, periods_of(records))


def _measured_currents(kind: Motor) -> set[str]:
    return {o.signal for o in kind.outputs if o.state in kind.currents}
