"""From states to measured outputs and back: offsets, and speeds that are differences.

A speed that is the difference of encoder counts is summed up again to a position, whose error is
one count, white; taken as a speed its noise would be hundreds of times larger and not white.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.algebra import largest_stride, project, widen
from motor_sysid.estimation.online.base import Tuning
from motor_sysid.estimation.online.laws import own_states
from motor_sysid.estimation.online.reading import add_shown, readings, shown_slopes
from motor_sysid.estimation.online.trust import judge, see, Trust
from motor_sysid.machine_code import kept
from motor_sysid.physics.model import Model, SpeedSensor

Array = NDArray[np.float64]

_FIRST_NOISE = 0.02
_FIRST_STEP = 0.1
_DOUBT = 1.03

_SHOWN, _TARGET, _BIAS, _DIFFERENCED, _UNUSED = range(5)


class Sensing:
    """Measurement model of a filter of (motor state, own states, parameters, offsets).

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
        self._n, self._theta = len(kind.states), kind.states.index('theta')
        self._omega = kind.states.index('omega')
        self.state = np.array([kind.states.index(known[s].state) for s in outputs])
        laws = readings(model, outputs, index, own_states(model))
        lawful = {outputs[channel] for channel in laws[4][1]}
        differenced = np.array([s == 'speed' and late and s not in lawful for s in outputs])
        unused = differenced & ('position' in outputs)
        target = np.where(differenced, self._theta, self.state)
        names = [known[s].bias for s in outputs]
        bias = [index.get(b, -1) for b in names]
        self._channels = np.array([self.state, target, bias, differenced, unused], dtype=np.int64)
        self._fixed = np.array([model[b] if b and b not in index else 0.0 for b in names])
        self._laws = laws
        self._given = np.array([tuning.noise.get(s, 0.0) for s in outputs])
        self.trust = Trust(len(outputs))
        self._sum = np.zeros(1)

    def begin(self, size: Array, dt: float) -> None:
        """Set the first guess of the noise: a part of the signals, or as given."""
        guess = _FIRST_NOISE * size[self.state]
        target, differenced = self._channels[_TARGET], self._channels[_DIFFERENCED] > 0
        guess = np.where(target == self._theta, _FIRST_STEP * dt * size[self._omega], guess)
        given = np.where(differenced, self._given * dt, self._given)
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
            if self._channels[_TARGET, j] == self._theta and not self._channels[_UNUSED, j]:
                sigma[self._theta] = np.sqrt(self.trust.variance[j])
        self._sum[0] = state[self._theta]
        self.trust.forget_last()
        return state, sigma

    def take_over(self, other: 'Sensing') -> None:
        """Go on from where another one of the same outputs is."""
        self.trust, self._sum = other.trust, other._sum

    def _offset(self, output: int, x: Array) -> float:
        index = self._channels[_BIAS, output]
        return float(self._fixed[output] + (x[index] if index >= 0 else 0.0))

    def outputs(self, before: Array, x: Array, h: float) -> Array:
        """Return (n_y,) outputs after a sample of length h s that began in state `before`."""
        y = np.empty(self._fixed.size)
        _predict_outputs(self._channels, self._fixed, *self._laws, before, x, h, y)
        return y

    def measure(
        self, y: Array, x: Array, p: Array, h: float, prior: Array, stride: Array
    ) -> tuple[Array, Array, Array, bool]:
        """Return what is to be learned from outputs (n_y,), NaN where missing.

        A spike in a differenced speed must not stay in its sum, which is set to the prediction.

        Parameters
        ----------
        x, p:
            (d,) state and (d, d) covariance of the filter, which is widened in place where it
            trusts itself too much.
        h:
            Length of the sample in s.
        prior, stride:
            (q,) standard deviation before any data, and the most that one sample may move, of
            the last q entries of the state.

        Returns
        -------
        (k,) measurements, their (k, d) rows of the state and (k,) noise variances, and whether the
        filter trusts itself too much.
        """
        return _measure(  # type: ignore[no-any-return]
            self._channels, self._fixed, self._sum, self.trust.table, *self._laws, y, x, p, h,
            prior, stride,
        )  # fmt: skip


@kept(error_model='numpy')
def _predict_outputs(  # type: ignore[no-untyped-def]
    channels, fixed, buffer, base, calls, reads, columns, factors, before, x, h, y
):  # fmt: skip
    """Set the outputs `y` (n_y,) that belong to a filter's state, see `Sensing.outputs`."""
    for j in range(y.size):
        target, bias = channels[_TARGET, j], channels[_BIAS, j]
        if channels[_DIFFERENCED, j]:
            y[j] = (x[target] - before[target]) / h
        else:
            y[j] = x[target] + fixed[j] + (x[bias] if bias >= 0 else 0.0)
    add_shown(buffer, base, calls, reads, columns, factors, x, x, y)


@kept(error_model='numpy')
def _measure(  # type: ignore[no-untyped-def]
    channels, fixed, total, table, buffer, base, calls, reads, columns, factors, y, x, p, h,
    prior, stride,
):  # fmt: skip
    """Weigh a sample, see `Sensing.measure`; `total` (1,) is the sum of the speed."""
    values = _summed(channels, fixed, total, y, x, h)
    see(table, values)
    used = np.flatnonzero(np.isfinite(values))
    slopes, shown = np.empty((y.size, x.size)), np.empty(y.size)
    shown_slopes(
        buffer, base, calls, reads, columns, factors, x, channels[_SHOWN], shown, slopes
    )  # fmt: skip
    z, rows = np.empty(used.size), np.zeros((used.size, x.size))
    innovation = np.empty(used.size)
    for k in range(used.size):
        _set_row(channels[:, used[k]], slopes[used[k]], rows[k])
        z[k] = values[used[k]] + np.dot(slopes[used[k]], x) - shown[used[k]]
        innovation[k] = z[k] - np.dot(rows[k], x)
    cross, spread = project(p, rows)
    noise, spike, doubt = judge(table, used, innovation, spread)
    for k in range(used.size):
        if spike[k] and channels[_DIFFERENCED, used[k]]:
            total[0] = x[channels[_TARGET, used[k]]]
    if doubt:
        widen(p, prior, _DOUBT)
        cross, spread = project(p, rows)
    for k in range(used.size):
        spread[k, k] += noise[k]
    ratio = largest_stride(cross, spread, innovation, stride)
    for k in range(used.size):  # no sample may move a parameter further than its stride
        noise[k] += (ratio - 1.0) * spread[k, k]
    return z, rows, noise, doubt


@kept(error_model='numpy')
def _summed(channels, fixed, total, y, x, h):  # type: ignore[no-untyped-def]
    """Return (n_y,) outputs without fixed offsets, a differenced speed as its sum; NaN if unused.

    Where the speed is lost the sum goes on from the filter's state.
    """
    values = np.empty(y.size)
    for j in range(y.size):
        values[j] = y[j]
        if channels[_DIFFERENCED, j]:
            lost = not np.isfinite(y[j])
            total[0] = x[channels[_TARGET, j]] if lost else total[0] + y[j] * h
            values[j] = np.nan if lost or channels[_UNUSED, j] else total[0]
        values[j] -= fixed[j]
    return values


@kept(error_model='numpy')
def _set_row(channel, slopes, row):  # type: ignore[no-untyped-def]
    """Write the row (d,) of one output: its state, its offset, the slopes of its laws."""
    row[channel[_TARGET]] = 1.0
    if channel[_BIAS] >= 0:
        row[channel[_BIAS]] = 1.0
    for i in range(row.size):
        row[i] += slopes[i]
