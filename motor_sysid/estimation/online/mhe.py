"""Moving-horizon estimation: least squares of the output error over the last second.

    minimize  |z - center|^2_arrival  +  sum over the window of (measured - simulated)^2 / variance

over where the motion began and over the parameters ``z``, within their bounds.  (Rao, Rawlings and
Mayne 2003, doi:10.1109/TAC.2002.808470.)  Each pass over the window is one Gauss-Newton step: a
few simulated steps for every new sample, so that no sample waits for an optimization (the
real-time iteration of Diehl, Bock and Schloeder 2005, doi:10.1137/S0363012902400713).  A filter of
the motion says where a window begins and makes the predictions; laws that depend on the angle of
the shaft see the angle that it followed.

What physics lacks is not filtered away within a window, but no single measurement counts beyond
three standard deviations, and the variances are those of the residuals.  Where these jump, what
was known before is believed less.  The covariance is that
of the normal equations, widened by what the residuals of the window's parts have in common, and by
how far parameters may have wandered within the memory.
"""

from collections.abc import Sequence
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.arrival import Arrival, bounded_step
from motor_sysid.estimation.online.base import Estimate, OnlineEstimator, Tuning
from motor_sysid.estimation.online.coordinates import Coordinates
from motor_sysid.estimation.online.horizon import Horizon, Summary
from motor_sysid.estimation.online.joint import JointFilter
from motor_sysid.estimation.online.laws import LawColumns, own_states
from motor_sysid.estimation.online.motion import Motion
from motor_sysid.estimation.online.sizes import prior_sigma, Sizes
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

_PACE = 4
_SHORTEST = 0.25
_STRIDE = 0.5
_REACH = 5.0
_KNOWN = 0.5
_SMOOTH = 0.3
_SURPRISE = 2.0
_LEAST = 1e-4


class Mhe(OnlineEstimator):
    """Moving-horizon estimator with an arrival cost.

    Parameters
    ----------
    model, dt, outputs, tuning:
        See `OnlineEstimator`.

    Attributes
    ----------
    tracker:
        The filter of the motion.
    """

    def __init__(self, model: Model, dt: float, outputs: Sequence[str], tuning: Tuning) -> None:
        self._model, self._dt, self._tuning = model, dt, tuning
        self.tracker = JointFilter(model, dt, outputs, tuning, shown_by_sensors(model, outputs))
        added = self.tracker.names
        delays = [f'{key}.{effect(key).card.delay}' for key in model.effects]
        moved = [
            p.name for p in model.parameters.free if p.name not in added and p.name not in delays
        ]
        self._coordinates = Coordinates([model.parameters[name] for name in (*moved, *added)])
        self._p = len(moved)
        self._z = self._coordinates.vector([p.value for p in self._coordinates.parameters])
        self._start, self._arrival = self._z.copy(), Arrival(self._z)
        motion = Motion(model, Coordinates([model.parameters[name] for name in moved]))
        self._n = n = motion.states
        sizes = n, len(model.kind.arguments), len(outputs), len(moved), len(added)
        self._length = max(round(tuning.horizon / dt), 8)
        self._horizon = Horizon(motion, sizes, self._length, dt, _PACE)
        self._scale, self._inflation = np.ones(n), 1.0
        self._sizes: Sizes | None = None
        self._covariance = np.zeros((self._z.size, self._z.size))
        self._absorbed = 0
        bounded_step(np.eye(2), np.ones(2), -np.ones(2), np.ones(2))

    def restart(self, y: Array) -> None:
        """Take up the motion anew; parameters keep what is known of them."""
        self.tracker.restart(y)
        self._horizon.clear()
        self._absorbed = 0

    def step(self, time: float, h: float, u: Array, y: Array) -> Array:
        """Predict, take the sample into the window, and go on with the pass over it."""
        before = self.tracker.state
        predicted = self.tracker.step(time, h, u, y)
        if self.tracker.sizes is None:
            return predicted
        self._grow(self.tracker.sizes)
        steps = max(round(h / self._dt), 1)
        for k in range(steps):
            seen = self.tracker.seen if k == steps - 1 else None
            self._horizon.push(before, time + k * self._dt, u, seen)
        self._work()
        return predicted

    def _grow(self, sizes: Sizes) -> None:
        """Widen the priors as larger inputs and motions are seen."""
        if sizes is self._sizes:
            return
        fresh = prior_sigma(self._model, self._coordinates.names, sizes, self._dt)
        first, before = self._sizes is None, self._arrival.prior
        self._arrival.widen(fresh)
        more = self._arrival.prior**2 - (0.0 if first else before**2)
        self._covariance += np.diag(more)
        self._sizes = sizes

    def _work(self) -> None:
        if self._horizon.idle:
            if self._horizon.count < _SHORTEST * self._length:
                return
            assert self._sizes is not None
            log = self._coordinates.log[: self._p]
            steps = np.where(log, 1e-4, 1e-3 * self._arrival.prior[: self._p])
            self._horizon.begin(self._z, np.concatenate((1e-6 * self.tracker.spans, steps)))
        summary = self._horizon.work(self._scale)
        if summary is not None:
            self._learn(summary)

    def _learn(self, summary: Summary) -> None:
        """Take the step that a finished pass asks for."""
        if not np.isfinite(summary.blocks).all():
            self._horizon.clear()
            return
        n, sums = self._n, summary.blocks.sum(axis=0)
        begin = self._begin()
        information, pull = sums[:, :-1].copy(), sums[:, -1].copy()
        information[:n, :n] += begin
        information[n:, n:] += self._arrival.information
        pull[n:] += self._arrival.information @ (self._arrival.center - summary.parameters)
        step = bounded_step(information, pull, *self._bounds(summary.parameters))
        self._z = summary.parameters + step[n:]
        self._judge(summary, information, step)
        self._leave(summary, begin)
        self._use()

    def _begin(self) -> Array:
        """Return what is known beforehand of where a window begins, (n, n)."""
        return np.diag(1.0 / np.maximum(self.tracker.spans, 1e-9) ** 2)

    def _bounds(self, z: Array) -> tuple[Array, Array]:
        """Return how far a step may go down and up, (n + d,): in its box and not too far."""
        prior, log = self._arrival.prior, self._coordinates.log
        stride = np.where(log, _STRIDE, _STRIDE * prior)
        lower, upper = self._coordinates.reach(self._start, _REACH, prior)
        free = np.full(self._n, np.inf)
        down, up = np.maximum(lower - z, -stride), np.minimum(upper - z, stride)
        return np.append(-free, np.minimum(down, 0.0)), np.append(free, np.maximum(up, 0.0))

    def _judge(self, summary: Summary, information: Array, step: Array) -> None:
        """Learn variances from the residuals, and how much the parts of a window agree."""
        fresh = np.maximum(summary.power, 1.0)
        surprise = float(np.nanmax(fresh / self._scale, initial=1.0))
        if surprise > _SURPRISE:
            self._arrival.fade(_SURPRISE / surprise)
        self._scale = np.where(
            np.isfinite(fresh), self._scale + _SMOOTH * (fresh - self._scale), self._scale
        )
        pulls = summary.blocks[:, :, -1] - summary.blocks[:, :, :-1] @ step
        inverse = np.linalg.inv(information)
        common = float(np.sum(pulls @ inverse * pulls)) / step.size
        self._inflation += _SMOOTH * (max(common, _LEAST) - self._inflation)
        covariance = self._inflation * inverse[self._n :, self._n :]
        wander = self._tuning.drift**2 * self._tuning.memory
        covariance = covariance + np.diag(wander * self._arrival.prior**2)
        size = np.sqrt(np.diag(covariance))
        shrink = np.minimum(self._arrival.prior / size, 1.0)
        covariance = covariance * np.outer(shrink, shrink)
        self._covariance = 0.5 * (covariance + covariance.T)

    def _leave(self, summary: Summary, begin: Array) -> None:
        """Give what leaves the window to the arrival cost."""
        next_first = max(0, self._horizon.count - self._length)
        ends = summary.first + summary.step * np.arange(1, len(summary.blocks) + 1)
        leaving = (ends <= next_first) & (ends - summary.step >= self._absorbed)
        if not leaving.any():
            return
        passed = summary.step * self._dt * int(leaving.sum())
        keep = math.exp(-passed / self._tuning.memory)
        sums = summary.blocks[leaving].sum(axis=0)
        self._arrival.absorb(sums, begin, summary.parameters, keep)
        self._absorbed = int(ends[leaving].max())

    def _use(self) -> None:
        """Have the filter of the motion use what is well known."""
        values = self._coordinates.values(self._z)
        known = np.sqrt(np.diag(self._covariance)) < _KNOWN * self._arrival.prior
        names = self._coordinates.names[: self._p]
        pairs = zip(names, values.tolist(), known, strict=False)
        self.tracker.motion.set_values({name: value for name, value, sure in pairs if sure})

    def estimate(self) -> dict[str, Estimate]:
        """Return the free parameters; delays are as they were."""
        values, slope = self._coordinates.values(self._z), self._coordinates.slope(self._z)
        spread = np.sqrt(np.diag(self._covariance))
        lower, upper = self._coordinates.reach(self._start, _REACH, self._arrival.prior)
        sure = (spread < _KNOWN * self._arrival.prior) & (lower < self._z) & (self._z < upper)
        found: dict[str, Estimate] = {}
        for p in self._model.parameters.free:
            if self._sizes is None or p.name not in self._coordinates.names:
                found[p.name] = Estimate(p.value, p.sigma or math.inf, p.unit, False)
                continue
            k = self._coordinates.names.index(p.name)
            sigma = float(spread[k] * slope[k])
            found[p.name] = Estimate(float(values[k]), sigma, p.unit, bool(sure[k]))
        return found

    def covariance(self) -> Array:
        """Return the covariance of the parameters."""
        return self._covariance.copy()


def shown_by_sensors(model: Model, outputs: Sequence[str]) -> list[str]:
    """Return the free parameters that add to measurements and do not move the motor."""
    biases = {o.bias for o in model.kind.outputs if o.bias}
    sensors = [f'{signal}_sensor' for signal in outputs]
    signals = (*model.kind.states, *own_states(model))
    columns = LawColumns(model, sensors, signals, memory=False).columns
    names = biases | {column.name for column in columns}
    return [p.name for p in model.parameters.free if p.name in names]
