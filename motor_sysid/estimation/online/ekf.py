"""Extended Kalman filter over the motion and, jointly, its parameters.

The state is that of the motor kind, followed by the estimated parameters (logarithms of positive
ones) and sensor offsets.  The step is the simulator's own, exact for the linear motor, and its
Jacobian a central difference of it.  (Ljung 1979, doi:10.1109/TAC.1979.1101943, on the joint
filter; filterpy does the measurement update in Joseph's form.)
"""

from collections.abc import Sequence

from filterpy.kalman import ExtendedKalmanFilter
import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.base import Estimate, OnlineEstimator, Tuning
from motor_sysid.estimation.online.coordinates import Coordinates
from motor_sysid.estimation.online.motion import Motion
from motor_sysid.estimation.online.sensing import Sensing
from motor_sysid.estimation.online.sizes import prior_sigma, Sizes
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

_GROWTH = 1.1
_KNOWN = 0.5
_DOUBT = 1.03
_REACH_LOG = 2.5
_REACH = 4.0


class Ekf(OnlineEstimator):
    """Joint filter of motion and parameters.

    Parameters
    ----------
    model, dt, outputs, tuning:
        See `OnlineEstimator`.
    estimated:
        Names of the parameters to estimate; by default the free ones.
    """

    def __init__(
        self,
        model: Model,
        dt: float,
        outputs: Sequence[str],
        tuning: Tuning,
        estimated: Sequence[str] | None = None,
    ) -> None:
        names = [p.name for p in model.parameters.free] if estimated is None else list(estimated)
        delays = [f'{key}.{effect(key).card.delay}' for key in model.effects]
        biases = [o.bias for o in model.kind.outputs if o.bias in names]
        dynamic = [name for name in names if name not in delays and name not in biases]
        self.model, self._dt, self._tuning = model, dt, tuning
        self.coordinates = Coordinates([model.parameters[n] for n in (*dynamic, *biases)])
        self._reported = names
        self.motion = Motion(model, Coordinates([model.parameters[n] for n in dynamic]))
        self._sensing = Sensing(model, outputs, self.coordinates.names[len(dynamic) :], tuning)
        self._n, self._p, self._d = len(model.kind.states), len(dynamic), len(names)
        self._unit = Sizes.per_unit(model)
        self._size, self._seen = 0.0, np.zeros(self._n)
        self._d = self._n + len(self.coordinates.names)
        self._filter = ExtendedKalmanFilter(self._d, max(len(outputs), 1))
        self._filter.x = np.concatenate([np.zeros(self._n), self.coordinates.vector(
            [model[name] for name in self.coordinates.names])])
        self._start = self._filter.x[self._n :].copy()
        self._filter.P = np.zeros((self._d, self._d))
        self._prior = np.zeros(self._d - self._n)
        self.nis = 0.0

    def restart(self, y: Array) -> None:
        """Take up the motion from measured outputs; parameters keep what is known of them."""
        x, p = self._filter.x, self._filter.P
        state, sigma = self._sensing.start(y, x, self._n, self._size * self._unit.state)
        x[: self._n] = state
        p[: self._n, :] = 0.0
        p[:, : self._n] = 0.0
        p[: self._n, : self._n] = np.diag(sigma**2)
        self.motion.forget()

    def step(self, time: float, h: float, u: Array, y: Array) -> Array:
        """Predict, remember the prediction, and correct."""
        self._grow(u, y)
        before = self._filter.x[: self._n].copy()
        if self._size == 0.0:
            self.restart(y)
            return self._sensing.outputs(before, self._filter.x, h)
        self._predict(time, h, u)
        predicted = self._sensing.outputs(before, self._filter.x, h)
        self._correct(h, y)
        return predicted

    def _grow(self, u: Array, y: Array) -> None:
        """Widen the priors of amplitudes and offsets as larger inputs and motions are seen."""
        size = max(self._size, float(np.max(np.abs(u))))
        seen = np.fmax(self._seen, np.abs(self._sensing.states(y)))
        sizes = self._unit.seen(size, seen)
        known = self._unit.seen(self._size, self._seen)
        grown = np.any(sizes.state > _GROWTH * known.state) or size > _GROWTH * self._size
        if size == 0.0 or not grown:
            return
        fresh = prior_sigma(self.model, self.coordinates.names, sizes, self._dt)
        added = np.maximum(fresh**2 - self._prior**2, 0.0)
        index = np.arange(self._n, self._d)
        self._filter.P[index, index] += added
        self._prior = np.maximum(fresh, self._prior)
        self._size, self._seen, self._sizes = size, seen, sizes
        self._sensing.begin(sizes.state, self._dt)

    def _predict(self, time: float, h: float, u: Array) -> None:
        n, p = self._n, self._p
        x = self._filter.x
        z = x[n : n + p]
        steps = np.concatenate([
            1e-6 * (self._sizes.state + np.abs(x[:n])),
            np.where(self.motion_log, 1e-4, 1e-3 * self._prior[:p]),
        ])
        move = self.motion.advance(x[:n], z, steps, u, time, h)
        jacobian = np.eye(self._d)
        jacobian[:n, :n] = move.by_state
        jacobian[:n, n : n + p] = move.by_parameter
        self._filter.F = jacobian
        self._filter.Q = self._process_noise(move.by_force, h)
        self._filter.x = np.concatenate([move.state, x[n:]])
        covariance = jacobian @ self._filter.P @ jacobian.T + self._filter.Q
        self._filter.P = 0.5 * (covariance + covariance.T)

    @property
    def motion_log(self) -> NDArray[np.bool_]:
        """Which of the moved parameters are logarithms."""
        return self.coordinates.log[: self._p]

    def _process_noise(self, by_force: Array, h: float) -> Array:
        """Unexplained forces, and parameters that wander as long as they are well known."""
        n, tuning = self._n, self._tuning
        q = np.zeros((self._d, self._d))
        kick = by_force * (tuning.disturbance * self._sizes.force * np.sqrt(1e-3 / h))
        q[:n, :n] = kick @ kick.T
        index = np.arange(n, self._d)
        room = 1.0 - self._filter.P[index, index] / self._prior**2
        q[index, index] = (tuning.drift * self._prior) ** 2 * h * np.maximum(room, 0.0)
        return q

    def _correct(self, h: float, y: Array) -> None:
        f = self._filter
        z, rows, noise = self._sensing.measured(y, f.x, h)
        if z.size == 0:
            return
        innovation = z - rows @ f.x
        spread = np.einsum('ij,jk,ik->i', rows, f.P, rows)
        noise, doubt = self._sensing.judge(innovation, spread)
        if doubt:
            self._widen(_DOUBT)
        f.update(z, lambda x: rows, lambda x: rows @ x, np.diag(noise))
        f.P = 0.5 * (f.P + f.P.T)
        self.nis = float(f.y @ np.linalg.solve(f.S, f.y))
        n = self._n
        reach = np.where(self.coordinates.log, _REACH_LOG, _REACH * self._prior)
        moved = np.clip(f.x[n:], self._start - reach, self._start + reach)
        f.x[n:] = self.coordinates.clipped(moved)

    def _widen(self, factor: float) -> None:
        """Trust the prediction less, but no parameter less than before any data."""
        f = self._filter
        f.P = f.P * factor
        index = np.arange(self._n, self._d)
        over = np.sqrt(np.maximum(f.P[index, index] / self._prior**2, 1.0))
        shrink = np.concatenate([np.ones(self._n), 1.0 / over])
        f.P = shrink[:, np.newaxis] * f.P * shrink

    def estimate(self) -> dict[str, Estimate]:
        """Return the free parameters with their standard deviations."""
        z = self._filter.x[self._n :]
        values, slope = self.coordinates.values(z), self.coordinates.slope(z)
        index = np.arange(self._n, self._d)
        spread = np.sqrt(np.maximum(self._filter.P[index, index], 0.0))
        known = spread < _KNOWN * self._prior
        found: dict[str, Estimate] = {}
        for name in self._reported:
            p = self.model.parameters[name]
            if name in self.coordinates.names:
                k = self.coordinates.names.index(name)
                sigma = float(spread[k] * slope[k]) if self._size else np.inf
                found[name] = Estimate(float(values[k]), sigma, p.unit, bool(known[k]))
            else:
                found[name] = Estimate(p.value, p.sigma or np.inf, p.unit, False)
        return found

    def covariance(self) -> Array:
        """Return the covariance of states, then parameters."""
        return np.array(self._filter.P)
