"""From states to measured outputs and back: offsets, differenced speeds, noise, outliers.

A speed that is the difference of encoder counts is summed up again to a position, whose error is
one count, white; taken as a speed its noise would be hundreds of times larger and not white.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.base import Tuning
from motor_sysid.physics.model import Model, SpeedSensor

Array = NDArray[np.float64]

_FIRST_NOISE = 0.02
_FIRST_STEP = 0.1
_PATIENCE = 20.0
_LONGEST = 3000.0
_OUTLIER = 4.0
_TALLEST = 9.0
_MOMENT = 50.0
_TOLERATED = 1.5
_BIAS = 12.0


class Sensing:
    """Measurement model of an EKF whose state is (motor state, parameters, offsets).

    Parameters
    ----------
    model:
        The model.
    outputs:
        Measured signals.
    biases:
        Sensor offsets at the end of the filter's state.
    tuning:
        Settings.
    """

    def __init__(
        self, model: Model, outputs: Sequence[str], biases: Sequence[str], tuning: Tuning
    ) -> None:
        kind = model.kind
        known = {o.signal: o for o in kind.outputs}
        self._outputs = tuple(outputs)
        self._model, self._biases = model, tuple(biases)
        self._state = np.array([kind.states.index(known[s].state) for s in outputs], dtype=np.intp)
        self._bias = [known[s].bias for s in outputs]
        late = model.speed_sensor is SpeedSensor.DIFFERENCE
        self._differenced = [s == 'speed' and late for s in outputs]
        whole = 'position' in outputs
        self._used = [j for j, d in enumerate(self._differenced) if not (d and whole)]
        self._theta = kind.states.index('theta')
        self._target = np.where(self._differenced, self._theta, self._state)
        self._sum = 0.0
        self._before = np.full(len(outputs), np.nan)
        self._quantum = np.full(len(outputs), np.inf)
        self._noise = np.zeros(len(outputs))
        self._given = np.array([tuning.noise.get(s, 0.0) for s in outputs])
        self._count = np.zeros(len(outputs))
        self._last = np.zeros(len(outputs))
        self._excess = np.ones(len(outputs))
        self._mean = np.zeros(len(outputs))
        self._rows: NDArray[np.intp] = np.empty(0, dtype=np.intp)

    def _offset(self, output: int, x: Array) -> float:
        name = self._bias[output]
        if not name:
            return 0.0
        if name in self._biases:
            return float(x[x.size - len(self._biases) + self._biases.index(name)])
        return self._model[name]

    def states(self, y: Array) -> Array:
        """Return (n,) what the outputs say of the states directly, NaN where nothing."""
        found = np.full(len(self._model.kind.states), np.nan)
        found[self._state] = y
        return found

    def begin(self, size: Array, dt: float) -> None:
        """Set the first guess of the noise: a part of the signals, or as given."""
        guess = np.where(self._differenced, _FIRST_STEP * dt, _FIRST_NOISE) * size[self._state]
        given = np.where(self._differenced, self._given * dt, self._given)
        guess = np.where(given > 0, given, guess)
        self._noise = np.where(self._count > 0, self._noise, guess**2)

    def start(self, y: Array, x: Array, n: int, size: Array) -> tuple[Array, Array]:
        """Return (n,) state and standard deviation from one sample."""
        state, sigma = np.zeros(n), np.maximum(size, 1e-9)
        state[self._theta] = x[self._theta]
        for j, value in enumerate(y):
            if np.isfinite(value):
                state[self._state[j]] = value - self._offset(j, x)
                sigma[self._state[j]] *= 0.1
        self._sum = float(state[self._theta])
        self._before[:] = np.nan
        for j in self._used:
            if self._target[j] == self._theta:
                sigma[self._theta] = np.sqrt(self._noise[j])
        return state, sigma

    def outputs(self, before: Array, x: Array, h: float) -> Array:
        """Return (n_y,) outputs after a sample of length h s that began in state `before`."""
        y = np.empty(len(self._outputs))
        for j, target in enumerate(self._target):
            now = float(x[target])
            y[j] = (now - before[target]) / h if self._differenced[j] else now + self._offset(j, x)
        return y

    def measured(self, y: Array, x: Array, h: float) -> tuple[Array, Array]:
        """Return measurements (k,) and their rows (k, d) of the state."""
        values = np.array(y)
        for j, differenced in enumerate(self._differenced):
            if differenced:
                lost = not np.isfinite(y[j])
                self._sum = float(x[self._theta]) if lost else self._sum + y[j] * h
                values[j] = np.nan if lost else self._sum
        self._see_quantum(values)
        self._rows = np.array([j for j in self._used if np.isfinite(values[j])], dtype=np.intp)
        rows = np.zeros((self._rows.size, x.size))
        for k, j in enumerate(self._rows):
            rows[k, self._target[j]] = 1.0
            if self._bias[j] in self._biases:
                rows[k, x.size - len(self._biases) + self._biases.index(self._bias[j])] = 1.0
            elif self._bias[j]:
                values[j] -= self._model[self._bias[j]]
        return values[self._rows], rows

    def _see_quantum(self, values: Array) -> None:
        """Note the smallest change of each signal: noise cannot be less than rounding."""
        change = np.abs(values - self._before)
        real = change > 1e-9 * np.abs(values)
        self._quantum = np.where(real, np.fmin(self._quantum, change), self._quantum)
        self._before = values.copy()

    def _rounding(self) -> Array:
        return np.where(np.isfinite(self._quantum), self._quantum**2 / 12, 0.0)

    def judge(self, innovation: Array, spread: Array) -> tuple[Array, bool]:
        """Learn from an innovation (k,) whose predicted variance, without noise, is `spread`.

        Returns
        -------
        noise, doubt:
            Noise variances (k,), larger where this sample is a spike; and whether the filter
            trusts itself too much, as innovations show that stay large or keep their sign.
        """
        rows = self._rows
        jump = innovation - self._last[rows]
        noise = np.maximum(self._noise[rows], self._rounding()[rows])
        total = spread + noise
        spike = np.maximum(jump**2 / (2 * total) / _OUTLIER**2, 1.0)
        self._last[rows] = np.where(spike > 1, self._last[rows], innovation)
        self._count[rows] += 1
        weight = 1.0 / np.minimum(_PATIENCE + self._count[rows], _LONGEST)
        fresh = np.minimum(0.5 * jump**2, _TALLEST * noise)
        self._noise[rows] = noise + weight * (fresh - noise)
        power = np.minimum(innovation**2 / total, _TALLEST * np.maximum(self._excess[rows], 1.0))
        self._excess[rows] += (power - self._excess[rows]) / _MOMENT
        step = np.clip(innovation / np.sqrt(total), -3.0, 3.0)
        self._mean[rows] += (step - self._mean[rows]) / _MOMENT
        biased = np.any(2 * _MOMENT * self._mean[rows] ** 2 > _BIAS)
        large = np.any(self._excess[rows] > _TOLERATED)
        return spike * total - spread, bool(biased or large)
