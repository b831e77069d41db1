"""A joint filter of motion and parameters, the engine of the Kalman filters.

The state is that of the motor kind and its effects' own (the twist of a shaft, heat), followed by
the estimated parameters and sensor offsets.  The step is the simulator's own, exact for the linear
motor, and its Jacobian a central difference of it.  (Ljung 1979, doi:10.1109/TAC.1979.1101943, on
the joint filter.)

Where a parameter is wrong, changes, or physics is missing, such a filter soon believes itself too
much.  Three things keep it honest: no sample may move a parameter far, and while innovations stay
too large or keep their sign, both the covariance grows (Zhou and Frank, Int. J. Control 65, 1996,
on such tracking filters) and the unexplained torque and voltage that it reckons with.
"""

from collections.abc import Callable, Mapping, Sequence
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.algebra import joseph, propagate, settle
from motor_sysid.estimation.online.base import Estimate, Tuning
from motor_sysid.estimation.online.coordinates import Coordinates
from motor_sysid.estimation.online.motion import Motion, Move
from motor_sysid.estimation.online.sensing import Sensing
from motor_sysid.estimation.online.sizes import prior_sigma, Sizes
from motor_sysid.machine_code import kept
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]
Update = Callable[[Array, Array, Array, Array, Array], tuple[Array, Array]]
"""A measurement update: see `motor_sysid.estimation.online.algebra.joseph`."""
MakeUpdate = Callable[[int, int, int], Update]
"""Makes one, for so many states of the motor, states in all, and outputs."""
Transform = Callable[[Motion, Array, Array, Array, Array, float, float], Move]
"""Carries state (d,) and covariance through a sample: see `linearized`."""
MakeTransform = Callable[[int, int], Transform]
"""Makes one, for so many states of the motor and parameters that move it."""


def compiled(motor: int, states: int, outputs: int) -> Update:
    """Return the update that costs least."""
    update: Update = joseph
    return update


def linearized(motor: int, moved: int) -> Transform:
    """Return the transform by central differences at the estimate."""

    def transform(
        motion: Motion, x: Array, cov: Array, steps: Array, u: Array, time: float, h: float
    ) -> Move:
        return motion.advance(x[:motor], x[motor : motor + moved], steps, u, time, h)

    return transform


_GROWTH = 1.1
_KNOWN = 0.5
_REACH = 5.0
_STRIDE = 0.3
_LEAST = 0.03
_RISE, _FALL, _MOST = 1.02, 0.999, 1e3
_ROUNDING = 1.0 + 1e-8
"""Growth of each variance in a sample, so that rounding leaves no direction below nothing."""
_UNSEEN = 1e-9
"""Size (SI) of an own state of an effect that has not been anything but zero."""


def sensor_parameters(model: Model) -> list[str]:
    """Return the parameters of the model's motor that only its sensors show: offsets."""
    return [*(o.bias for o in model.kind.outputs if o.bias), *model.kind.shown]


class JointFilter:
    """Extended Kalman filter over the motion and, jointly, its parameters.

    Parameters
    ----------
    model, dt, outputs, tuning:
        See `motor_sysid.estimation.online.base.OnlineEstimator`.
    estimated:
        Names of the parameters to estimate; by default the free ones.
    update:
        Makes the measurement update.
    transform:
        Makes what carries the estimate from sample to sample.

    Attributes
    ----------
    lost:
        How often the filter had to begin anew because a number was no longer finite, or the
        covariance of what was measured no longer one.
    seen:
        (k,) what was measured last, (k, d) its slopes by the state, (k,) its noise variances.
    """

    def __init__(
        self,
        model: Model,
        dt: float,
        outputs: Sequence[str],
        tuning: Tuning,
        estimated: Sequence[str] | None = None,
        update: MakeUpdate = compiled,
        transform: MakeTransform = linearized,
    ) -> None:
        names = [p.name for p in model.parameters.free] if estimated is None else list(estimated)
        delays = [f'{key}.{effect(key).card.delay}' for key in model.effects]
        biases = [name for name in sensor_parameters(model) if name in names]
        moved = [name for name in names if name not in delays and name not in biases]
        self.model, self._dt, self._tuning, self._reported = model, dt, tuning, names
        self._coordinates = Coordinates([model.parameters[n] for n in (*moved, *biases)])
        self.motion = Motion(model, Coordinates([model.parameters[n] for n in moved]))
        self._n, self._p = self.motion.states, len(moved)
        plain = np.flatnonzero(~self._coordinates.log)
        index = {self._coordinates.names[k]: self._n + int(k) for k in plain}
        self._sensing = Sensing(model, outputs, index, tuning)
        self._unit = Sizes.per_unit(model)
        self._start = self._coordinates.vector([model[n] for n in self._coordinates.names])
        # two filters would be too sure of own states, which no sensor shows
        make = update if self._n == len(model.kind.states) else compiled
        self._update = make(self._n, self._n + self._start.size, len(outputs))
        self._transform = transform(self._n, self._p)
        self.lost = 0
        self._begin()
        self._nothing = np.empty(0), np.empty((0, self._x.size)), np.empty(0)
        self.seen = self._nothing

    def _begin(self) -> None:
        """Forget all data."""
        n, size = self._n, self._n + self._start.size
        self._index = np.arange(n, size)
        self._x = np.concatenate([np.zeros(n), self._start])
        self._cov = np.zeros((size, size))
        self._prior = np.zeros(size - n)
        self._size, self._seen = 0.0, np.zeros(len(self.model.kind.states))
        self._own = np.full(n - self._seen.size, _UNSEEN)
        self._sizes = self._unit.seen(0.0, self._seen)
        self._box = self._coordinates.reach(self._start, _REACH, self._prior)
        self._unrest = 1.0
        self._limit = np.zeros(len(self._sensing.state))
        self._rescale()

    def restart(self, y: Array) -> None:
        """Take up the motion from measured outputs; parameters keep what is known of them."""
        n, beginning = self._n, self.motion.beginning
        state, sigma = self._sensing.start(y, self._x, self._sizes.state)
        self._x[:n], spread = beginning(state), beginning(sigma)
        spread[state.size :] = np.maximum(spread[state.size :], self._own)
        self._cov[:n, :] = self._cov[:, :n] = 0.0
        self._cov[:n, :n] = np.diag(spread**2)

    def take_over(self, other: 'JointFilter', found: Mapping[str, tuple[float, float]]) -> None:
        """Go on from the motion of another filter, and parameters found elsewhere.

        Parameters
        ----------
        other:
            A filter of the same model and outputs.
        found:
            Parameter name to value and standard deviation.
        """
        n, x, cov = self._n, self._x, self._cov
        self._seen, self._own = other._seen.copy(), other._own.copy()
        self._resize(other._size)
        x[:n], cov[:n, :n] = other._x[:n], other._cov[:n, :n]
        self._sensing.take_over(other._sensing)
        for k, p in enumerate(self._coordinates.parameters):
            if p.name in found:
                value, sigma = found[p.name]
                one = Coordinates([p])
                z = one.vector([min(max(value, p.lower), p.upper)])
                x[n + k] = np.clip(z[0], self._box[0][k], self._box[1][k])
                spread = max(sigma / float(one.slope(z)[0]), _LEAST * self._prior[k])
                cov[n + k, n + k] = min(spread, self._prior[k]) ** 2

    def step(self, time: float, h: float, u: Array, y: Array) -> Array:
        """Predict, note the prediction, and correct."""
        self.seen = self._nothing
        self._grow(u, y)
        before = self._x[: self._n].copy()
        if self._size == 0.0:
            self.restart(y)
            return self._sensing.outputs(before, self._x, h)
        sound = self._predict(time, h, u)
        predicted = self._sensing.outputs(before, self._x, h)
        if not (sound and self._correct(h, y)):
            self.lost += 1
            self._begin()
            self._grow(u, y)
            self.restart(y)
        return predicted

    def _grow(self, u: Array, y: Array) -> None:
        """Widen the priors of amplitudes and offsets as larger inputs and motions are seen."""
        size = _outgrown(u, y, self._size, self._limit)
        if size < 0.0:
            return
        np.fmax.at(self._seen, self._sensing.state, np.abs(y))
        if max(size, self._size) > 0.0:
            self._resize(max(size, self._size))

    def _resize(self, size: float) -> None:
        """Set what follows from the largest input and the largest states seen."""
        sizes = self._unit.seen(size, self._seen)
        fresh = prior_sigma(self.model, self._coordinates.names, sizes, self._dt)
        self._cov[self._index, self._index] += np.maximum(fresh**2 - self._prior**2, 0.0)
        self._size, self._sizes, self._prior = size, sizes, np.maximum(fresh, self._prior)
        self._box = self._coordinates.reach(self._start, _REACH, self._prior)
        self._rescale()
        top = sizes.state >= self._unit.state * size
        self._limit = np.where(top, np.inf, _GROWTH * sizes.state)[self._sensing.state]
        self._sensing.begin(sizes.state, self._dt)

    def _rescale(self) -> None:
        """Set what is measured by the priors and sizes."""
        log, tuning = self._coordinates.log, self._tuning
        self._stride = np.where(log, _STRIDE, _STRIDE * self._prior)
        steps = np.where(log, 1e-4, 1e-3 * self._prior)[: self._p]
        self._steps = np.concatenate((np.zeros(self._n), steps))
        self._push = tuning.disturbance * self._sizes.force
        self._wander = (tuning.drift * self._prior) ** 2

    def _predict(self, time: float, h: float, u: Array) -> bool:
        """Predict state and covariance; tell whether they are finite."""
        _set_steps(self._steps, self._x[: self._n], self.spans)
        move = self._transform(self.motion, self._x, self._cov, self._steps, u, time, h)
        push = self._unrest * math.sqrt(1e-3 / h)
        self._cov, sound = _spread(
            self._x, self._cov, move.state, move.slope, move.by_force, move.curve, push,
            self._push, self._wander, self._prior, h,
        )  # fmt: skip
        if sound and self._own.size:
            self._own = np.maximum(self._own, np.abs(move.state[self._seen.size :]))
        return bool(sound)

    def _correct(self, h: float, y: Array) -> bool:
        """Weigh what was measured; tell whether its covariance could be inverted."""
        try:
            return self._weigh(h, y)
        except np.linalg.LinAlgError:
            return False

    def _weigh(self, h: float, y: Array) -> bool:
        z, rows, noise, doubt = self._sensing.measure(
            y, self._x, self._cov, h, self._prior, self._stride
        )
        if z.size == 0:
            return True
        self.seen = z, rows, noise
        unrest = self._unrest * (_RISE if doubt else _FALL)
        self._unrest = min(max(unrest, 1.0), _MOST)
        self._x, self._cov = self._update(self._x, self._cov, z, rows, noise)
        settle(self._x, self._cov, *self._box)
        return True

    def estimate(self) -> dict[str, Estimate]:
        """Return the free parameters with their standard deviations."""
        z = self._x[self._n :]
        values, slope = self._coordinates.values(z), self._coordinates.slope(z)
        spread = np.sqrt(np.maximum(self._cov[self._index, self._index], 0.0))
        sigma = np.where(self._prior > 0, spread * slope, np.inf)
        inside = (self._box[0] < z) & (z < self._box[1])
        known = (spread < _KNOWN * self._prior) & inside
        found: dict[str, Estimate] = {}
        for name in self._reported:
            p = self.model.parameters[name]
            if name in self._coordinates.names:
                k = self._coordinates.names.index(name)
                found[name] = Estimate(float(values[k]), float(sigma[k]), p.unit, bool(known[k]))
            else:
                found[name] = Estimate(p.value, p.sigma or np.inf, p.unit, False)
        return found

    @property
    def names(self) -> tuple[str, ...]:
        """Estimated parameters in the order of the whole state, in which they come last."""
        return self._coordinates.names

    @property
    def state(self) -> Array:
        """Motor state and own states of effects (n,), now."""
        return np.array(self._x[: self._n])

    @property
    def sizes(self) -> Sizes | None:
        """Sizes of states and forces for the inputs so far; None before any input."""
        return self._sizes if self._size > 0 else None

    @property
    def spans(self) -> Array:
        """Sizes of all states (n,) so far."""
        return np.append(self._sizes.state, self._own)

    def covariance(self) -> Array:
        """Return the covariance of states, then parameters."""
        return np.array(self._cov)


@kept()
def _outgrown(u, y, size, limit):  # type: ignore[no-untyped-def]
    """Return the size of the input (n_u,), or -1 where it and outputs (n_y,) are as known."""
    largest = 0.0
    for k in range(u.size):
        largest = max(largest, abs(u[k]))
    for j in range(y.size):
        if abs(y[j]) > limit[j]:
            return largest
    return largest if largest > _GROWTH * size else -1.0


@kept()
def _set_steps(steps, x, size):  # type: ignore[no-untyped-def]
    """Set the steps of the differences by the state (n,)."""
    for j in range(x.size):
        steps[j] = 1e-6 * (size[j] + abs(x[j]))


@kept(error_model='numpy')
def _spread(  # type: ignore[no-untyped-def]
    x, p, state, slope, by_force, curve, unrest, push, wander, prior, h
):
    """Put the state in its place; return the covariance (d, d) after a sample, and its soundness.

    `push` (m,) are the unexplained forces, one standard deviation in a sample of 1 ms.
    """
    forces = by_force.shape[1]
    kick = np.empty((state.size, forces + curve.shape[1]))
    for j in range(state.size):
        x[j] = state[j]
        for m in range(forces):
            kick[j, m] = by_force[j, m] * (unrest * push[m])
        for m in range(curve.shape[1]):
            kick[j, forces + m] = curve[j, m]
    after = propagate(p, slope, kick, wander, prior, h)
    n = state.size
    for j in range(after.shape[0]):
        if j < n or after[j, j] < prior[j - n] ** 2:
            after[j, j] *= _ROUNDING
    return after, np.isfinite(after.sum() + x.sum())
