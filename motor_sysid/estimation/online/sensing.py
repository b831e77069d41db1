"""From states to measured outputs and back: offsets, and speeds that are differences.

A speed that is the difference of encoder counts is summed up again to a position, whose error is
one count, white; taken as a speed its noise would be hundreds of times larger and not white.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.base import Tuning
from motor_sysid.estimation.online.reading import Reading
from motor_sysid.estimation.online.trust import Trust
from motor_sysid.physics.model import Model, SpeedSensor

Array = NDArray[np.float64]

_FIRST_NOISE = 0.02
_FIRST_STEP = 0.1


class Sensing:
    """Measurement model of a filter whose state is (motor state, parameters, offsets).

    Parameters
    ----------
    model:
        The model.
    outputs:
        Measured signals.
    index:
        Where estimated parameters that are no logarithms lie in the filter's state.
    tuning:
        Settings.
    """

    def __init__(
        self, model: Model, outputs: Sequence[str], index: Mapping[str, int], tuning: Tuning
    ) -> None:
        kind = model.kind
        known = {o.signal: o for o in kind.outputs}
        late = model.speed_sensor is SpeedSensor.DIFFERENCE
        self._names, self._n = kind.states, len(kind.states)
        self._theta, self._omega = kind.states.index('theta'), kind.states.index('omega')
        self.state = np.array([kind.states.index(known[s].state) for s in outputs], dtype=np.intp)
        self._readings = [Reading(model, s, known[s].state, index) for s in outputs]
        self._lawful = any(self._readings)
        self._differenced = [
            s == 'speed' and late and not reading
            for s, reading in zip(outputs, self._readings, strict=True)
        ]
        self._unused = [d and 'position' in outputs for d in self._differenced]
        self._target = np.where(self._differenced, self._theta, self.state)
        names = [known[s].bias for s in outputs]
        self._fixed = [model[b] if b and b not in index else 0.0 for b in names]
        self._bias = [index.get(b, 0) for b in names]
        self._given = np.array([tuning.noise.get(s, 0.0) for s in outputs])
        self.trust = Trust(len(outputs))
        self._used: NDArray[np.intp] = np.empty(0, dtype=np.intp)
        self._sum = 0.0

    def begin(self, size: Array, dt: float) -> None:
        """Set the first guess of the noise: a part of the signals, or as given."""
        guess = _FIRST_NOISE * size[self.state]
        guess = np.where(self._target == self._theta, _FIRST_STEP * dt * size[self._omega], guess)
        given = np.where(self._differenced, self._given * dt, self._given)
        self.trust.guess(np.where(given > 0, given, guess) ** 2)

    def start(self, y: Array, x: Array, size: Array) -> tuple[Array, Array]:
        """Return (n,) state and standard deviation from one sample (n_y,)."""
        state, sigma = np.zeros(self._n), np.maximum(size, 1e-9)
        state[self._theta] = x[self._theta]
        sigma[self._theta] = 1e-6
        for j, value in enumerate(y):
            if np.isfinite(value):
                state[self.state[j]] = value - self._offset(j, x)
                sigma[self.state[j]] *= 0.1
            if self._target[j] == self._theta and not self._unused[j]:
                sigma[self._theta] = np.sqrt(self.trust.variance[j])
        self._sum = float(state[self._theta])
        self.trust.forget_last()
        return state, sigma

    def take_over(self, other: 'Sensing') -> None:
        """Go on from where another one of the same outputs is."""
        self.trust, self._sum = other.trust, other._sum

    def _offset(self, output: int, x: Array) -> float:
        index = self._bias[output]
        return self._fixed[output] + (float(x[index]) if index else 0.0)

    def outputs(self, before: Array, x: Array, h: float) -> Array:
        """Return (n_y,) outputs after a sample of length h s that began in state `before`."""
        y = np.empty(len(self._target))
        for j, target in enumerate(self._target):
            now = float(x[target])
            y[j] = (now - before[target]) / h if self._differenced[j] else now + self._offset(j, x)
        if self._lawful:
            signals = self._signals(x)
            y += [reading.shown(signals, x) for reading in self._readings]
        return y

    def _signals(self, x: Array) -> dict[str, float]:
        return dict(zip(self._names, x[: self._n].tolist(), strict=True))

    def measured(self, y: Array, x: Array, h: float) -> tuple[Array, Array]:
        """Return measurements (k,) and their rows (k, d) of the state."""
        values = np.array(y)
        for j, differenced in enumerate(self._differenced):
            if differenced:
                lost = not np.isfinite(y[j])
                self._sum = float(x[self._theta]) if lost else self._sum + y[j] * h
                values[j] = np.nan if lost or self._unused[j] else self._sum
            values[j] -= self._fixed[j]
        self.trust.see(values)
        self._used = np.flatnonzero(np.isfinite(values))
        rows = np.zeros((self._used.size, x.size))
        for row, channel in zip(rows, self._used, strict=True):
            row[self._target[channel]] = 1.0
            if self._bias[channel]:
                row[self._bias[channel]] = 1.0
        if self._lawful:
            self._linearize(x, values, rows)
        return values[self._used], rows

    def _linearize(self, x: Array, values: Array, rows: Array) -> None:
        """Add the slopes of sensor laws to the rows, and what they are off to the measurements."""
        signals = self._signals(x)
        for row, channel in zip(rows, self._used, strict=True):
            reading = self._readings[channel]
            if reading:
                plain = float(row @ x)
                by_state, by_parameter = reading.slopes(signals, x)
                row[self._target[channel]] += by_state
                for at, slope in by_parameter.items():
                    row[at] += slope
                values[channel] += float(row @ x) - plain - reading.shown(signals, x)

    def judge(self, innovation: Array, spread: Array, x: Array) -> tuple[Array, bool]:
        """Return noise variances (k,) and whether the filter trusts itself too much.

        A spike in a differenced speed must not stay in its sum, which is set to the prediction.
        """
        noise, spike, doubt = self.trust.judge(self._used, innovation, spread)
        for j in self._used[spike]:
            if self._differenced[j]:
                self._sum = float(x[self._theta])
        return noise, doubt
