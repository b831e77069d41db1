"""The speed controller of a recording, read from reference, measured speed and input.

    u = kp e + ki sum(e) dt - kd dy/dt + c,   e = r - y

The sum stands still while the input is at a limit and the error would drive it further.  What the
controller saw and what it gave are both recorded, so its gains are an ordinary least-squares fit
in which the noise of the speed is no error but part of the regressors.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.model import Model
from motor_sysid.signals.lattice import lattice
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

WELL = 0.95
"""Share of the recorded input that a controller must give to be believed."""

_LIMITED = 5
_DELAYS = (0, 1)
_DERIVATIVE_HELPS = 0.8


@dataclass(frozen=True)
class Controller:
    """A PI or PID speed controller with limits.

    Attributes
    ----------
    kp, ki, kd:
        Input per speed error, per error and second, and per change of speed per second.
    constant:
        Input at zero error at the start.
    lower, upper:
        Limits of the input.
    resolution:
        Step of the input, or 0.
    delay:
        Samples by which the speed that it sees is old.
    quality:
        Share of the recorded input that it gives when it is fed with the recorded speed: 1 less
        the RMS of what it misses over the standard deviation of the input.
    """

    kp: float
    ki: float
    kd: float
    constant: float
    lower: float
    upper: float
    resolution: float
    delay: int
    quality: float

    @property
    def words(self) -> str:
        """Gains and quality, in words."""
        kind = 'PID' if self.kd else 'PI'
        gains = f'kp {self.kp:.4g}, ki {self.ki:.4g}' + (f', kd {self.kd:.3g}' if self.kd else '')
        return f'{kind} ({gains}) gives {100 * self.quality:.2f} % of the recorded input'


@dataclass(frozen=True)
class _Log:
    """What a controller saw and gave: (N,) each."""

    error: Array
    slope: Array
    sum: Array
    given: Array
    free: NDArray[np.bool_]


def fit_controller(model: Model, record: Record) -> Controller | None:
    """Fit a controller to a uniform record; None where no single speed loop was recorded."""
    names = input_signals(record, model.kind)
    if len(names) != 1 or 'speed_reference' not in record or 'speed' not in record:
        return None
    given = record[names[0]]
    lower, upper = -_limit(-given), _limit(given)
    found = lattice(given)
    step = found.step if found else 0.0
    tried = []
    for delay in _DELAYS:
        log = _log(record, names[0], lower, upper, delay)
        plain, rich = (_fitted(log, lower, upper, step, delay, d) for d in (False, True))
        better = 1 - rich.quality < _DERIVATIVE_HELPS * (1 - plain.quality)
        tried.append(rich if better and rich.kd > 0 else plain)
    return max(tried, key=lambda one: one.quality)


def _limit(values: Array) -> float:
    """Return the largest value if it is reached often enough to be a limit, else infinity."""
    top = float(np.max(values))
    reached = np.sum(values >= top - 1e-6 * float(np.ptp(values)))
    return top if reached >= max(_LIMITED, 1e-3 * values.size) else np.inf


def _log(record: Record, name: str, lower: float, upper: float, delay: int) -> _Log:
    given, seen = record[name], record['speed']
    if delay:
        seen = np.concatenate((np.repeat(seen[:1], delay), seen[:-delay]))
    error = record['speed_reference'] - seen
    edge = 1e-6 * float(np.ptp(given))
    at_top, at_bottom = given >= upper - edge, given <= lower + edge
    moves = np.where((at_top & (error > 0)) | (at_bottom & (error < 0)), 0.0, error * record.dt)
    total = np.concatenate(([0.0], np.cumsum(moves)[:-1]))
    slope = np.diff(seen, prepend=seen[:1]) / record.dt
    return _Log(error, slope, total, given, ~(at_top | at_bottom))


def _fitted(
    log: _Log, lower: float, upper: float, step: float, delay: int, derivative: bool
) -> Controller:
    columns = [np.ones_like(log.error), log.error, log.sum]
    x = np.column_stack([*columns, -log.slope] if derivative else columns)
    size = np.maximum(np.sqrt(np.mean(x[log.free] ** 2, axis=0)), 1e-300)
    values = np.linalg.lstsq(x[log.free] / size, log.given[log.free], rcond=1e-10)[0] / size
    missed = log.given - np.clip(x @ values, lower, upper)
    quality = 1.0 - float(np.sqrt(np.mean(missed**2)) / max(float(np.std(log.given)), 1e-300))
    constant, kp, ki = values[:3].tolist()
    kd = float(values[3]) if derivative else 0.0
    return Controller(kp, ki, kd, constant, lower, upper, step, delay, quality)
