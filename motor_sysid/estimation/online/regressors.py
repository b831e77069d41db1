"""The signals that regressions read, at both ends of a sample, from measured outputs."""

from collections.abc import Iterable, Mapping, Sequence
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.estimation.online.despike import Sample
from motor_sysid.estimation.online.reading import Reading
from motor_sysid.physics.model import Model, SpeedSensor

Array = NDArray[np.float64]
Signals = dict[str, float]


class End(NamedTuple):
    """The signals at one end of a sample.

    Attributes
    ----------
    measured:
        For the terms of a balance: what the sensors say, in the form that belongs to the filter.
    tracked:
        For the laws, which may be steep: states without the rounding of an encoder.
    """

    measured: Signals
    tracked: Signals

RAW = 'raw '
"""Before the name of a state: as measured, its sensor's estimated offset not taken off."""

_PATIENCE = 3
_NONE = np.empty(0)
_SLOW = 1e-2


class Regressors:
    """Measured outputs as states and inputs of a motor.

    A speed that is a difference, or that is taken from the position, is the mean over the sample
    and stands for both of its ends; a missing position is the sum of the speed.  Up to three
    missing samples in a row are bridged by holding.

    Between two samples a state that answers the held input with a time constant of a few samples
    is an exponential, not a straight line; it is given the line of the same mean.  Sensor laws of
    effects are undone with the model's parameters.

    Parameters
    ----------
    model:
        The model.
    outputs:
        Measured signals.
    """

    def __init__(self, model: Model, outputs: Sequence[str]) -> None:
        kind = model.kind
        self._inputs, self._states = kind.arguments, kind.states
        known = {o.signal: o for o in kind.outputs}
        self._column = {known[s].state: j for j, s in enumerate(outputs)}
        biases = {known[s].state: known[s].bias for s in outputs}
        self._bias = {state: bias for state, bias in biases.items() if bias}
        self._fixed = {b: model[b] for b in self._bias.values() if not model.parameters[b].free}
        readings = {known[s].state: Reading(model, s, known[s].state, {}) for s in outputs}
        self._readings = {state: one for state, one in readings.items() if one}
        difference = model.speed_sensor is SpeedSensor.DIFFERENCE
        self._mean_speed = difference or 'omega' not in self._column
        self._title, self._rates = kind.title, dict.fromkeys(self._column, 0.0)
        self._pull: dict[str, Array] = {}
        self.restart(np.full(len(outputs), np.nan))

    def require(self, names: Iterable[str]) -> None:
        """Refuse if a name cannot be had.

        Raises
        ------
        UserError
            With the name and the remedies.
        """
        have = {*self._column, *self._inputs}
        if 'theta' in have or 'omega' in have:
            have |= {'theta', 'omega'}
        missing = sorted(set(names) - have)
        if missing:
            raise UserError(
                f'recursive least squares of a {self._title} needs `{", ".join(missing)}` '
                'measured; name the topic for it, or use the estimator `ekf`'
            )

    def set_dynamics(self, a: Array) -> None:
        """Set the system matrix (n, n) of the linear core."""
        rates = dict(zip(self._states, np.maximum(-np.diag(a), 0.0).tolist(), strict=True))
        self._rates = {state: rates[state] for state in self._column}
        pull = a - np.diag(np.diag(a))
        self._pull = {s: pull[self._states.index(s)] / max(r, 1e-300) for s, r in rates.items()}

    def restart(self, y: Array) -> None:
        """Begin at measured outputs."""
        self._last = np.where(np.isfinite(y), y, 0.0)
        self._missing = int(not np.all(np.isfinite(y))) * (_PATIENCE + 1)
        self._angle = 0.0
        if 'theta' in self._column:
            self._angle = float(self._last[self._column['theta']])

    def take(self, sample: Sample, known: Mapping[str, float]) -> tuple[End, End] | None:
        """Return the signals at the start and the end of a sample, or None after a dropout.

        Parameters
        ----------
        sample:
            The sample; its outputs are NaN where missing.
        known:
            Present estimates of sensor offsets.
        """
        fine = bool(np.all(np.isfinite(sample.y)))
        self._missing = 0 if fine else self._missing + 1
        before, now = self._last, np.where(np.isfinite(sample.y), sample.y, self._last)
        self._last = now
        first, last = self._signals(before, known), self._signals(now, known)
        inputs = dict(zip(self._inputs, sample.u.tolist(), strict=True))
        first.update(inputs, t=sample.time)
        last.update(inputs, t=sample.time + sample.length)
        self._bend(first, last, sample)
        self._add_motion(first, last, sample.length)
        if self._missing > _PATIENCE:
            return None
        return self._end(first, sample.before), self._end(last, sample.after)

    def _end(self, signals: Signals, state: Array) -> End:
        return End(signals, {**signals, **dict(zip(self._states, state.tolist(), strict=True))})

    def _signals(self, y: Array, known: Mapping[str, float]) -> Signals:
        found: Signals = {}
        for state, j in self._column.items():
            value, bias = float(y[j]), self._bias.get(state, '')
            found[RAW + state] = value - self._fixed.get(bias, 0.0)
            found[state] = value - (self._fixed.get(bias, 0.0) or known.get(bias, 0.0))
        for state, reading in self._readings.items():
            more = reading.shown(found, _NONE)
            found[state], found[RAW + state] = found[state] - more, found[RAW + state] - more
        return found

    def _bend(self, first: Signals, last: Signals, sample: Sample) -> None:
        """Shift the line of each state so that its mean is that of the exponential.

        What the other states pull it along in the sample is straight, the rest is exponential.
        """
        for state, rate in self._rates.items():
            a = rate * sample.length
            if a > _SLOW:
                share = -1 / math.expm1(-a) - 1 / a - 0.5
                pulled = float(self._pull[state] @ (sample.after - sample.before))
                shift = share * (last[state] - first[state] - pulled)
                for name in (state, RAW + state):
                    first[name] += shift
                    last[name] += shift

    def _add_motion(self, first: Signals, last: Signals, h: float) -> None:
        """Add the speed from the position, or the position from the speed."""
        if 'omega' not in self._column and 'theta' in self._column:
            last['omega'] = (last['theta'] - first['theta']) / h
        if 'omega' in last and self._mean_speed:
            first['omega'] = last['omega']
        if 'theta' not in self._column and 'omega' in last:
            first['theta'] = self._angle
            self._angle += 0.5 * h * (first['omega'] + last['omega'])
            last['theta'] = self._angle
        for name in ('omega', 'theta'):
            for signals in (first, last):
                if name in signals:
                    signals[RAW + name] = signals[name]
