"""The signals that regressions read, at both ends of a sample, from measured outputs."""

from collections.abc import Iterable, Mapping, Sequence
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.estimation.online.derived import DerivedSignals
from motor_sysid.estimation.online.despike import Sample
from motor_sysid.estimation.online.reading import add_shown, readings, sensor_lags
from motor_sysid.machine_code import kept
from motor_sysid.physics.effect import arguments
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors.base import Motor

Array = NDArray[np.float64]

RAW = 'raw '
"""Before the name of a state: as measured, its sensor's estimated offset not taken off."""

_PATIENCE = 3
_SLOW = 1e-2


def signal_names(kind: Motor) -> tuple[str, ...]:
    """Return the names of the signals of a motor kind in the order of their vector."""
    raw = (RAW + state for state in kind.states)
    return (*kind.states, *kind.arguments, 't', 'turn', *kind.derived, *raw)


class Regressors:
    """Measured outputs as states and inputs of a motor.

    A speed that is a difference, or that is taken from the position, is the mean over the sample
    and stands for both of its ends; a missing position is the sum of the speed.  Up to three
    missing samples in a row are bridged by holding.

    Between two samples a state that answers the held input with a time constant of a few samples
    is an exponential, not a straight line; it is given the line of the same mean.  Sensor laws of
    effects are undone with the model's parameters, filters of first order by ``y + lag dy/dt``.

    Parameters
    ----------
    model:
        The model.
    outputs:
        Measured signals.

    Raises
    ------
    UserError
        If something moves the motor's states at once, or a sensor cannot be undone.

    Attributes
    ----------
    measured:
        (2, S) signals at the start and the end of the sample taken last, for the terms of a
        balance: what the sensors say, in the form that belongs to the filter.
    tracked:
        (2, S) the same for the laws, which may be steep: with states from a filter, without the
        rounding of an encoder.
    """

    def __init__(self, model: Model, outputs: Sequence[str]) -> None:
        kind = model.kind
        if kind.jumps:
            raise UserError(
                f'regressions do not know what happens at once in a {kind.title}: R and L would '
                'come out wrong; use `ekf`, `ukf`, `dual_ekf` or `mhe`, or in batch '
                '`least_squares`'
            )
        states = kind.states
        self._title, self._inputs, self._states = kind.title, kind.arguments, states
        shown = {o.state: outputs.index(o.signal) for o in kind.outputs if o.signal in outputs}
        self._bias = {o.state: o.bias for o in kind.outputs if o.bias and o.state in shown}
        self._column = np.array([shown.get(state, -1) for state in states], dtype=np.int64)
        difference = model.speed_sensor is SpeedSensor.DIFFERENCE
        mean_speed = int(difference or 'omega' not in shown)
        self._motion = np.array([states.index('omega'), states.index('theta'), mean_speed])
        lags = sensor_lags(model, outputs)
        self._lag = np.array([lags.get(state, 0.0) for state in states])
        self._offset = np.zeros((2, len(states)))
        for state, bias in self._bias.items():
            if not model.parameters[bias].free:
                self._offset[:, states.index(state)] = model[bias]
        self._shown_names = kind.shown
        self._shown = np.array([model[name] for name in kind.shown])
        self._readings = readings(model, outputs, {n: k for k, n in enumerate(kind.shown)})
        self._rates, self._pull = np.zeros(len(states)), np.zeros((len(states), len(states)))
        self.measured = np.zeros((2, len(signal_names(kind))))
        self.tracked = np.zeros_like(self.measured)
        self._angle = np.zeros(1)
        self._derived = DerivedSignals(model, signal_names(kind))
        asked = {n: arguments(law) for n, law in kind.derived.items()}
        self._needed = {name: set(parameters) for name, parameters in asked.items()}
        self._held = set(model.parameters.values())
        self.restart(np.full(len(outputs), np.nan))

    def require(self, names: Iterable[str]) -> None:
        """Refuse if a name cannot be had.

        Raises
        ------
        UserError
            With the name and the remedies.
        """
        seen = [s for s, column in zip(self._states, self._column, strict=True) if column >= 0]
        have = {*seen, *self._inputs}
        if 'theta' in have or 'omega' in have:
            have |= {'theta', 'omega'}
        asked = {n for name in names for n in self._needed.get(name, {name})}
        missing = sorted(asked - have - self._held)
        if missing:
            raise UserError(
                f'recursive least squares of a {self._title} needs `{", ".join(missing)}` '
                'measured; name the topic for it, or use the estimator `ekf`'
            )

    def set_dynamics(self, a: Array) -> None:
        """Set the system matrix (n, n) of the linear core."""
        self._rates = np.maximum(-np.diag(a), 0.0)
        self._pull = (a - np.diag(np.diag(a))) / np.maximum(self._rates, 1e-300)[:, np.newaxis]

    def set_offsets(self, known: Mapping[str, float]) -> None:
        """Set the present estimates of sensor offsets."""
        for state, bias in self._bias.items():
            if bias in known:
                self._offset[1, self._states.index(state)] = known[bias]

    def set_sensors(self, known: Mapping[str, float]) -> None:
        """Set the present estimates of parameters that only laws of sensors read."""
        for k, name in enumerate(self._shown_names):
            self._shown[k] = known.get(name, self._shown[k])

    def restart(self, y: Array) -> None:
        """Begin at measured outputs."""
        self._last = np.where(np.isfinite(y), y, 0.0)
        self._missing = int(not np.all(np.isfinite(y))) * (_PATIENCE + 1)
        column = self._column[self._motion[1]]
        self._angle[0] = self._last[column] if column >= 0 else 0.0

    def take(self, sample: Sample) -> bool:
        """Set the signals from a sample, whose outputs are NaN where missing.

        Returns
        -------
        Whether they are of use: not after a dropout.
        """
        before, self._last = self._last, self._last.copy()
        fine = _set_ends(
            sample.y, before, self._last, self._column, self._offset, *self._readings,
            self._shown, self.measured,
        )  # fmt: skip
        _bend(
            self.measured, self.tracked, sample.u, sample.time, sample.length, sample.before,
            sample.after, self._column, self._lag, self._rates, self._pull, self._motion,
            self._angle,
        )  # fmt: skip
        self._derived.fill(self.measured)
        self._derived.fill(self.tracked)
        self._missing = 0 if fine else self._missing + 1
        return self._missing <= _PATIENCE


@kept(error_model='numpy')
def _set_ends(  # type: ignore[no-untyped-def]
    y, before, now, column, offset, buffer, base, calls, reads, columns, factors, shown, ends
):  # fmt: skip
    """Set states and raw states at both ends (2, S) from the outputs there.

    Parameters
    ----------
    y, before, now:
        (n_y,) outputs, those of the sample before, and both in one: `now` holds `before`, and is
        given what was measured.
    column, offset:
        (n,) output that shows each state, -1 for none; (2, n) sensor offsets to take off: raw
        (only the held ones), and all.

    Returns
    -------
    Whether every output was measured.
    """
    n, fine = column.size, True
    raw = ends.shape[1] - n
    for j in range(y.size):
        if math.isfinite(y[j]):
            now[j] = y[j]
        else:
            fine = False
    more = np.empty(y.size)
    for end in range(2):
        for s in range(n):
            value = 0.0
            if column[s] >= 0:
                value = before[column[s]] if end == 0 else now[column[s]]
            ends[end, raw + s] = value - offset[0, s]
            ends[end, s] = value - offset[1, s]
        more[:] = 0.0
        add_shown(buffer, base, calls, reads, columns, factors, ends[end], shown, more)
        for s in range(n):
            if column[s] >= 0:
                ends[end, raw + s] -= more[column[s]]
                ends[end, s] -= more[column[s]]
    return fine


@kept(error_model='numpy')
def _bend(  # type: ignore[no-untyped-def]
    ends, tracked, u, time, h, before, after, column, lag, rates, pull, motion, angle
):
    """Give both ends (2, S) time, input, motion and turn, and states the line of their mean.

    What the other states pull a state along in the sample is straight, the rest is exponential.
    What passed a filter with time constant `lag` (n,) is straight: before that it was later by so
    much of its slope, or, if it is a mean that was filtered as it was taken, by what that kept.
    `before` and `after` (n,) are the states at the ends as a filter knows them, `rates` (n,) and
    `pull` (n, n) the diagonal of the system matrix and the rest of it over the diagonal; `motion`
    tells where omega and theta are and whether the speed is a mean.
    """
    n = column.size
    raw = ends.shape[1] - n
    for end in range(2):
        for k in range(u.size):
            ends[end, n + k] = u[k]
        ends[end, n + u.size] = time + end * h
    for s in range(n):
        a = rates[s] * h
        if column[s] >= 0 and lag[s] > 0.0:
            mean = s == motion[0] and motion[2]
            ahead = 1 / math.expm1(h / lag[s]) if mean else lag[s] / h
            shift = ahead * (ends[1, s] - ends[0, s])
            for at in (s, raw + s):
                ends[0, at] += shift
                ends[1, at] += shift
        elif column[s] >= 0 and a > _SLOW:
            share = -1 / math.expm1(-a) - 1 / a - 0.5
            pulled = 0.0
            for k in range(n):
                pulled += pull[s, k] * (after[k] - before[k])
            shift = share * (ends[1, s] - ends[0, s] - pulled)
            for at in (s, raw + s):
                ends[0, at] += shift
                ends[1, at] += shift
    _add_motion(ends, h, column, motion, angle)
    tracked[:] = ends
    for s in range(n):
        tracked[0, s], tracked[1, s] = before[s], after[s]
    for end in range(2):
        ends[end, n + u.size + 1] = h * ends[end, motion[0]]
        tracked[end, n + u.size + 1] = h * tracked[end, motion[0]]


@kept(error_model='numpy')
def _add_motion(ends, h, column, motion, angle):  # type: ignore[no-untyped-def]
    """Add the speed from the position, or the position from the speed."""
    omega, theta, mean_speed = motion
    if column[omega] < 0 and column[theta] >= 0:
        ends[1, omega] = (ends[1, theta] - ends[0, theta]) / h
    if mean_speed:
        ends[0, omega] = ends[1, omega]
    if column[theta] < 0:
        ends[0, theta] = angle[0]
        angle[0] += 0.5 * h * (ends[0, omega] + ends[1, omega])
        ends[1, theta] = angle[0]
    raw = ends.shape[1] - column.size
    for s in (omega, theta):
        ends[0, raw + s], ends[1, raw + s] = ends[0, s], ends[1, s]
