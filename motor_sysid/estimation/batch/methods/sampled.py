"""The linear core of a motor, sampled with held inputs, over the states that its sensors show."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from motor_sysid.errors import UserError
from motor_sysid.machine_code import kept
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors.speed import measured_speed
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Core:
    """States and inputs of a motor whose core is linear and does not depend on its angle.

    Attributes
    ----------
    model:
        The model; its effects are not looked at.
    states:
        Names of its states but the angle.
    signals:
        The signal that shows each of them.
    """

    model: Model
    states: tuple[str, ...]
    signals: tuple[str, ...]

    @classmethod
    def of(cls, model: Model, method: str) -> 'Core':
        """Return that of a model; refuse a motor that has none.

        Raises
        ------
        UserError
            For a three-phase motor, whose equations multiply currents and speed.
        """
        kind = model.kind
        if kind.own is not None:
            raise UserError(
                f'`{method}` is for motors whose equations are linear, not for a {kind.title}; '
                'use `least_squares`'
            )
        shown = {o.state: o.signal for o in kind.outputs}
        states = tuple(name for name in kind.states if name != 'theta')
        return cls(model, states, tuple(shown[name] for name in states))

    def step(self, values: Mapping[str, float], dt: float) -> tuple[Array, Array]:
        """Return (n, n) and (n, n_u): what a sample of `dt` s makes of states and inputs."""
        table = {name: np.array([value]) for name, value in values.items()}
        a, b, _ = (part[0] for part in self.model.kind.matrices(table))
        keep = [self.model.kind.states.index(name) for name in self.states]
        n, m = len(keep), b.shape[1]
        block = np.zeros((n + m, n + m))
        block[:n, :n], block[:n, n:] = a[np.ix_(keep, keep)], b[keep]
        whole = expm(dt * block)
        return whole[:n, :n], whole[:n, n:]

    def measured(self, record: Record) -> tuple[Array, Array]:
        """Return (N, n) states as measured at the stamps, and (N, n_u) held inputs.

        A speed that is a mean over the sample before its stamp is averaged with the next one.

        Raises
        ------
        UserError
            If a state is not measured.
        """
        columns = []
        for state, signal in zip(self.states, self.signals, strict=True):
            if state == 'omega':
                columns.append(self._speed(record))
            elif signal in record:
                columns.append(record[signal])
            else:
                raise UserError(f'this method needs `{signal}` in the record')
        u = [record[name] for name in input_signals(record, self.model.kind)]
        return np.column_stack(columns)[:-1], np.column_stack(u)[:-1]

    def _speed(self, record: Record) -> Array:
        speed = measured_speed(record)
        if self.model.speed_sensor is not SpeedSensor.DIFFERENCE or 'speed' not in record:
            return speed
        return np.append(0.5 * (speed[:-1] + speed[1:]), speed[-1])


def one_rate(records: Sequence[Record], method: str) -> float:
    """Return the sample time of all records in s; refuse if they differ."""
    dt = records[0].dt
    if any(abs(record.dt / dt - 1) > 1e-3 for record in records):
        raise UserError(f'`{method}` takes records of one sample time; resample them')
    return dt


def response(phi: Array, drive: Array) -> Array:
    """Return (N, n, K) answers ``r[t + 1] = phi r[t] + drive[t]`` from rest, for (N, n, K)."""
    return np.asarray(_response(phi, drive))


@kept(error_model='numpy')
def _response(phi, drive):  # type: ignore[no-untyped-def]
    found = np.zeros_like(drive)
    count, n, width = drive.shape
    for t in range(count - 1):
        for a in range(n):
            for k in range(width):
                value = drive[t, a, k]
                for j in range(n):
                    value += phi[a, j] * found[t, j, k]
                found[t + 1, a, k] = value
    return found
