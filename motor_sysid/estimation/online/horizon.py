"""A window of samples, and a simulation that passes over it a few steps at a time.

A pass begins at the oldest sample of the window and carries the motion and its sensitivities to
where the motion began and to the parameters along; every measurement on the way adds to the
normal equations.  A new sample takes the pass a fixed number of steps on, so that the work per
sample does not depend on the length of the window.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.motion import Motion
from motor_sysid.machine_code import kept

Array = NDArray[np.float64]
Seen = tuple[Array, Array, Array]

BLOCKS = 40
"""Parts of the window that have normal equations of their own."""

_FAR = 9.0


class Summary(NamedTuple):
    """What a finished pass found.

    Attributes
    ----------
    blocks:
        (40, m, m + 1) weighted sums of ``a [a' r]`` over the parts of the window: ``a`` are the
        slopes of a measurement by where the motion began (n), by the parameters (p) and by what
        adds to measurements (q); ``r`` is measured minus simulated.
    power:
        (n,) mean square of ``r`` over its variance, by the state that was measured; NaN if none
        was.
    first, step:
        Number of the first sample, counted from the very first one, and samples of a part.
    parameters:
        (p + q,) for which this holds.
    """

    blocks: Array
    power: Array
    first: int
    step: int
    parameters: Array


class Horizon:
    """The last samples of a motor.

    Parameters
    ----------
    motion:
        Simulates it.
    sizes:
        States, inputs, outputs, parameters that move it and those that add to measurements.
    length:
        Samples of the window.
    dt:
        Sample time in s.
    pace:
        Steps that a pass makes for each new sample.

    Attributes
    ----------
    count:
        Samples so far.
    """

    def __init__(
        self, motion: Motion, sizes: tuple[int, ...], length: int, dt: float, pace: int
    ) -> None:
        n, inputs, outputs, p, q = sizes
        room = 2 * length
        self._motion, self._n, self._p = motion, n, p
        self._angle = motion.angle
        self._length, self._dt, self._pace = length, dt, pace
        self._state, self._input = np.zeros((room, n)), np.zeros((room, inputs))
        self._time = np.zeros(room)
        self._z, self._noise = np.zeros((room, outputs)), np.full((room, outputs), np.inf)
        self._rows = np.zeros((room, outputs, n + q))
        self._x, self._sensitivity = np.zeros(n), np.zeros((n, n + p))
        self._blocks = np.zeros((BLOCKS, n + p + q, n + p + q + 1))
        self._power = np.zeros((2, n))
        self._parameters, self._steps = np.zeros(p + q), np.zeros(n + p)
        self.clear()
        self._compile()

    def _compile(self) -> None:
        """Compile now: the first pass is a while off."""
        _carry(self._sensitivity, np.zeros_like(self._sensitivity))
        self._measure(0, np.ones(self._n), 0)
        self._blocks[:], self._power[:] = 0.0, 0.0

    def clear(self) -> None:
        """Forget all samples."""
        self.count, self._at, self._end, self._first = 0, 0, -1, 0

    def push(self, state: Array, time: float, u: Array, seen: Seen | None) -> None:
        """Take the next sample: where it begins, its input, and what is measured at its end."""
        k = self.count % len(self._time)
        self._state[k], self._time[k], self._input[k] = state, time, u
        self._noise[k] = np.inf
        if seen is not None:
            width = seen[0].size
            self._z[k, :width], self._rows[k, :width], self._noise[k, :width] = seen
        self.count += 1

    @property
    def idle(self) -> bool:
        """Whether there is no pass under way."""
        return self._end < 0

    def begin(self, parameters: Array, steps: Array) -> None:
        """Begin a pass.

        Parameters
        ----------
        parameters:
            (p + q,) coordinates of what moves the motor, then what adds to measurements.
        steps:
            (n + p,) steps of the differences.
        """
        self._first = max(0, self.count - self._length)
        self._at, self._end = self._first, self.count
        k = self._first % len(self._time)
        self._x = self._state[k].copy()
        self._sensitivity[:] = np.eye(self._n, self._n + self._p)
        self._blocks[:], self._power[:] = 0.0, 0.0
        self._parameters, self._steps = parameters.copy(), steps.copy()

    def work(self, scale: Array) -> Summary | None:
        """Go on with the pass; return what it found once it is done.

        Parameters
        ----------
        scale:
            (n,) factors of the noise variances, by the state that is measured.
        """
        step = max(-(-(self._end - self._first) // BLOCKS), 1)
        for _ in range(min(self._pace, self._end - self._at)):
            k = self._at % len(self._time)
            z = self._parameters[: self._p]
            move = self._motion.advance(
                self._x, z, self._steps, self._input[k], self._time[k], self._dt, self._turned()
            )
            _carry(self._sensitivity, move.slope)
            self._x = move.state
            self._measure(k, scale, (self._at - self._first) // step)
            self._at += 1
        if self._at < self._end:
            return None
        self._end = -1
        with np.errstate(invalid='ignore'):
            power = self._power[0] / np.where(self._power[1] > 0, self._power[1], np.nan)
        return Summary(self._blocks, power, self._first, step, self._parameters)

    def _turned(self) -> Array:
        """Return (2,) angle of the shaft at both ends of the sample, as it was when it came.

        What depends on it would go astray with an angle that is simulated over the window.
        """
        ends = (self._at, min(self._at + 1, self.count - 1))
        turned: Array = self._state[[k % len(self._time) for k in ends], self._angle]
        return turned

    def _measure(self, k: int, scale: Array, block: int) -> None:
        """Add sample `k` of the memory to the normal equations."""
        added = self._parameters[self._p :]
        _accumulate(
            self._x, self._sensitivity, added, self._z[k], self._rows[k], self._noise[k], scale,
            self._blocks[block], self._power,
        )  # fmt: skip


@kept()
def _carry(sensitivity, slope):  # type: ignore[no-untyped-def]
    """Carry sensitivities (n, n + p) through a sample with these slopes, in place."""
    n = sensitivity.shape[0]
    before = sensitivity.copy()
    for i in range(n):
        for j in range(sensitivity.shape[1]):
            value = slope[i, j] if j >= n else 0.0
            for k in range(n):
                value += slope[i, k] * before[k, j]
            sensitivity[i, j] = value


@kept()
def _accumulate(x, sensitivity, added, z, rows, noise, scale, block, power):  # type: ignore[no-untyped-def]
    """Add measurements to the normal equations (m, m + 1) and to the powers (2, n) of residuals.

    Residuals beyond three standard deviations count with their size, not with its square.
    """
    n, moved = sensitivity.shape
    m = moved + added.size
    a = np.empty(m + 1)
    for k in range(z.size):
        if not noise[k] < np.inf:
            continue
        shown, r = 0, z[k]
        for i in range(n):
            if abs(rows[k, i]) > abs(rows[k, shown]):
                shown = i
            r -= rows[k, i] * x[i]
        for j in range(moved):
            a[j] = 0.0
            for i in range(n):
                a[j] += rows[k, i] * sensitivity[i, j]
        for j in range(added.size):
            a[moved + j] = rows[k, n + j]
            r -= rows[k, n + j] * added[j]
        a[m] = r
        weight = 1.0 / (noise[k] * scale[shown])
        far = r * r * weight
        robust = 1.0 if far < _FAR else np.sqrt(_FAR / far)
        power[0, shown] += robust * r * r / noise[k]
        power[1, shown] += 1.0
        for i in range(m):
            for j in range(m + 1):
                block[i, j] += robust * weight * a[i] * a[j]
