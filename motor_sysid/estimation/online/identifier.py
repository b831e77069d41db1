"""Feed time stamped samples to an online estimator: gaps, dropouts, delays and running errors."""

from collections.abc import Mapping, Sequence
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.estimation.online.base import Estimate, OnlineEstimator, Tuning
from motor_sysid.estimation.online.estimators import known_estimator
from motor_sysid.machine_code import kept
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model, SpeedSensor

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_ERROR_MEMORY = 1.0

_MOTION = ('speed', 'position')
"""Outputs of which one tells the motion as well as both."""


class OnlineIdentifier:
    """Online estimates of a model's parameters, sample by sample.

    The result depends on the samples alone, not on how they are bunched: one call with a thousand
    samples leaves the same bits as a thousand calls with one.

    Of speed and position one is enough: one that has had no value is as if it was not named, and
    with its first value the estimator begins anew.

    Parameters
    ----------
    model:
        Where to start; its free parameters are estimated.
    estimator:
        Key of the estimator: see `ESTIMATORS`.
    dt:
        Nominal sample time in s.
    inputs, outputs:
        Names of the columns: a full set of inputs of the motor kind, and some of its outputs.
    tuning:
        Settings of the estimators.

    Attributes
    ----------
    samples, gaps, dropped:
        Samples taken; gaps in their stamps; samples refused because time did not advance.

    Raises
    ------
    UserError
        If the estimator is unknown, or the motor kind has no such inputs or outputs.
    """

    def __init__(
        self,
        model: Model,
        estimator: str,
        dt: float,
        inputs: Sequence[str],
        outputs: Sequence[str],
        tuning: Tuning | None = None,
    ) -> None:
        self._kind = known_estimator(estimator)
        if not (np.isfinite(dt) and dt > 0):
            raise UserError(f'sample time {dt:g} s is not positive')
        self.model, self.dt = model, float(dt)
        self._columns = _input_columns(model, inputs)
        self.outputs = _known_outputs(model, outputs)
        self._tuning = tuning or Tuning()
        self._keep = math.exp(-self.dt / _ERROR_MEMORY)
        self._begin()
        self._compile()
        self._begin()

    def _begin(self) -> None:
        """Forget all samples."""
        inputs, outputs = self._columns.size, len(self.outputs)
        self._awaited = {k for k, name in enumerate(self.outputs) if name in _MOTION}
        self._shown = np.arange(outputs)
        self._estimator = self._make()
        self._delay = _DelayLine(_delay(self.model), inputs)
        self.samples = self.gaps = self.dropped = 0
        self._last_time = np.nan
        self._held = np.zeros(inputs)
        self._prediction = np.full(outputs, np.nan)
        self._residual = np.full(outputs, np.nan)
        self._power = np.zeros((2, outputs))
        difference = self.model.speed_sensor is SpeedSensor.DIFFERENCE
        both = {'speed', 'position'} <= set(self.outputs)
        lines = difference and both and self._estimator.bridges
        self._slow = _SlowSpeed(self.outputs) if lines else None

    def _make(self) -> OnlineEstimator:
        """Return a fresh estimator for the outputs that are shown."""
        outputs = tuple(self.outputs[k] for k in self._shown)
        return self._kind(self.model, self.dt, outputs, self._tuning)

    def _compile(self) -> None:
        """Compile everything before the first sample: it may take seconds, once on a machine."""
        steps = np.arange(4.0)
        outputs = np.repeat(1e-3 * steps, len(self.outputs))
        self.update(self.dt * steps, np.ones(4 * self._columns.size), outputs)

    def update(
        self, t: Array, inputs: Array, outputs: Array, fresh: Mask | None = None
    ) -> None:
        """Take samples in order.

        Parameters
        ----------
        t:
            (K,) stamps in s.
        inputs:
            (K, n_u) inputs that act from each stamp to the next, NaN where not known.
        outputs:
            (K, n_y) outputs measured at the stamps, NaN where missing.
        fresh:
            (K, n_y) which outputs were measured then; the others lie between two that were, and
            are shown only to estimators that need a value at every sample.  None for all.
        """
        stamps = np.asarray(t, dtype=np.float64)
        u = np.array(inputs, dtype=np.float64, order='C').reshape(stamps.size, self._columns.size)
        y = np.array(outputs, dtype=np.float64, order='C').reshape(stamps.size, len(self.outputs))
        u = _arrange(u, self._columns, y)
        seen = y
        if self._slow is not None:
            self._slow.give_speeds(stamps, y, fresh)
        elif fresh is not None and not self._estimator.bridges:
            seen = np.where(fresh, y, np.nan)
        for k, time in enumerate(stamps.tolist()):
            self._take(time, u[k], seen[k], y[k])

    def _take(self, time: float, u: Array, seen: Array, y: Array) -> None:
        h = time - self._last_time
        if h <= 0 or not math.isfinite(time):
            self.dropped += 1
            return
        gap = not h <= self._tuning.gap * self.dt
        self.gaps += int(gap and self.samples > 0)
        if self._begins(y) or gap:
            self._estimator.restart(seen[self._shown])
            self._delay.fill(self._held)
            self._prediction[:] = self._residual[:] = np.nan
        else:
            held = self._delay.push(self._held, h)
            predicted = self._estimator.step(self._last_time, h, held, seen[self._shown])
            self._prediction[self._shown] = predicted
            _note(self._prediction, y, self._keep, self._residual, self._power)
        _hold(u, self._held)
        self._last_time, self._held = time, u
        self.samples += 1

    def _begins(self, y: Array) -> bool:
        """Make the estimator for what has had a value; tell whether it is another one now."""
        new = {k for k in self._awaited if math.isfinite(y[k])}
        if not new:
            return False
        self._awaited -= new
        needed = 'position' if self.model.kind.needs_position else ''
        missing = [k for k in self._awaited if self.outputs[k] != needed]
        before, self._shown = self._shown.size, np.delete(np.arange(y.size), missing)
        if self._shown.size == before:
            return False
        self._estimator = self._make()
        return True

    def estimate(self) -> Mapping[str, Estimate]:
        """Return value, sigma, unit and identifiability of every free parameter."""
        return self._estimator.estimate()

    def prediction(self) -> Mapping[str, float]:
        """Return the outputs as they were predicted for the last sample, NaN after a gap."""
        return dict(zip(self.outputs, self._prediction.tolist(), strict=True))

    def residual(self) -> Mapping[str, float]:
        """Return measured minus predicted for the last sample."""
        return dict(zip(self.outputs, self._residual.tolist(), strict=True))

    def errors(self) -> Mapping[str, float]:
        """Return the RMS of the residual of each output over the last second, NaN before any."""
        error, weight = self._power
        weight = np.where(weight > 0, weight, np.nan)
        return dict(zip(self.outputs, np.sqrt(error / weight).tolist(), strict=True))

    def current_model(self) -> Model:
        """Return the model with the estimates so far, inside their boxes."""
        values, sigmas = {}, {}
        for name, found in self.estimate().items():
            p = self.model.parameters[name]
            values[name] = min(max(found.value, p.lower), p.upper)
            sigmas[name] = found.sigma
        return self.model.with_estimates(values, sigmas)

    @property
    def estimator(self) -> OnlineEstimator:
        """The estimator itself."""
        return self._estimator


class _SlowSpeed:
    """The speed of a slow encoder as the difference of its positions, for what needs it always.

    Whether such a speed belongs to an instant or is the mean since the message before, its topic
    does not say; the difference of the positions between two messages is the mean from row to row.
    """

    def __init__(self, outputs: Sequence[str]) -> None:
        self._speed, self._position = outputs.index('speed'), outputs.index('position')
        self._slow, self._last = False, (math.nan, math.nan)

    def give_speeds(self, times: Array, y: Array, fresh: Mask | None) -> None:
        """Set the speeds among outputs (K, n_y), once one was seen that is not measured always."""
        if not self._slow and (fresh is None or fresh[:, self._speed].all()):
            for time, place in zip(times[-1:].tolist(), y[-1:, self._position], strict=True):
                self._last = time, float(place)
            return
        for k, time in enumerate(times.tolist()):
            self._slow = self._slow or (fresh is not None and not fresh[k, self._speed])
            (before, place), now = self._last, float(y[k, self._position])
            if self._slow and math.isfinite(now) and time > before:
                y[k, self._speed] = (now - place) / (time - before)
            self._last = time, now


class _DelayLine:
    """Held inputs that act a fixed time later, split between two samples if need be."""

    def __init__(self, delay: float, width: int) -> None:
        self._delay = delay
        self._pieces: list[tuple[float, Array]] = []
        self._width = width

    def fill(self, u: Array) -> None:
        """Start anew with an input that has been held for long."""
        self._pieces = [(self._delay, u)] if self._delay > 0 else []

    def push(self, u: Array, h: float) -> Array:
        """Take the input of the last `h` s; return the mean of what acted in that time."""
        if self._delay <= 0:
            return u
        self._pieces.append((h, u))
        acted, left = np.zeros(self._width), h
        while left > 0 and self._pieces:
            length, value = self._pieces[0]
            part = min(length, left)
            acted = acted + value * part
            left -= part
            if part < length:
                self._pieces[0] = (length - part, value)
            else:
                self._pieces.pop(0)
        return acted / h


def _delay(model: Model) -> float:
    cards = [(key, effect(key).card) for key in model.effects]
    return sum(model[f'{key}.{card.delay}'] for key, card in cards if card.delay)


def _input_columns(model: Model, inputs: Sequence[str]) -> NDArray[np.int64]:
    """Return the columns of the inputs in the motor kind's order."""
    for names in model.kind.inputs:
        if set(names) == set(inputs):
            return np.array([list(inputs).index(name) for name in names])
    wanted = ' or '.join('+'.join(names) for names in model.kind.inputs)
    raise UserError(f'a {model.kind.title} is driven by {wanted}, not by {"+".join(inputs)}')


def _known_outputs(model: Model, outputs: Sequence[str]) -> tuple[str, ...]:
    known = [o.signal for o in model.kind.outputs]
    wrong = [name for name in outputs if name not in known]
    if wrong or not outputs:
        raise UserError(
            f'a {model.kind.title} has outputs {", ".join(known)}; '
            f'got {", ".join(outputs) or "none"}'
        )
    return tuple(outputs)


@kept()
def _arrange(inputs, columns, outputs):  # type: ignore[no-untyped-def]
    """Return inputs (K, n_u) in the motor's order; make outputs (K, n_y) NaN if not finite."""
    u = np.empty((inputs.shape[0], columns.size))
    for k in range(inputs.shape[0]):
        for j in range(columns.size):
            u[k, j] = inputs[k, columns[j]]
        for j in range(outputs.shape[1]):
            if not math.isfinite(outputs[k, j]):
                outputs[k, j] = np.nan
    return u


@kept()
def _hold(u, before):  # type: ignore[no-untyped-def]
    """Replace what is not known of an input (n_u,) by the one before."""
    for j in range(u.size):
        if not math.isfinite(u[j]):
            u[j] = before[j]


@kept()
def _note(prediction, y, keep, residual, power):  # type: ignore[no-untyped-def]
    """Set the residual (n_y,), and keep its power over the last second or so."""
    for j in range(y.size):
        residual[j] = y[j] - prediction[j]
        if residual[j] == residual[j]:  # not NaN
            power[0, j] = keep * power[0, j] + (1 - keep) * residual[j] * residual[j]
            power[1, j] = keep * power[1, j] + (1 - keep)
