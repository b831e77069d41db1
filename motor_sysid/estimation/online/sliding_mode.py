"""A sliding-mode observer of the load torque, for a motor whose parameters are known.

A model of the speed is driven by the torques that are known, and by a correction ``v`` that forces
its error ``s`` to zero in finite time whatever the load does, as long as it does not change faster
than ``J C``; what this takes is the load:

    domega^/dt = known torques / J - v,
    v = 1.5 sqrt(C |s|) sign(s) + w,    dw/dt = 1.1 C sign(s),

with ``s = omega^ - omega`` and ``tau_l = J v``, smoothed.  (Super-twisting observer: Levant 1993,
doi:10.1080/00207179308923053; Davila, Fridman and Levant 2005, doi:10.1109/TAC.2005.858636.  Load
torques of drives by sliding modes: Utkin, Guldner and Shi, Sliding Mode Control in
Electromechanical Systems, 1999.)

It gives one estimate, that of the parameter of `constant_load_torque`; all others stay as the
model has them, and are said not to be identified.  Their uncertainty is part of the load's.
"""

from collections.abc import Sequence
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.estimation.online.base import Estimate, OnlineEstimator, Tuning
from motor_sysid.estimation.online.coordinates import Coordinates
from motor_sysid.estimation.online.despike import Despiker, Sample
from motor_sysid.estimation.online.joint import JointFilter
from motor_sysid.estimation.online.regressors import Regressors, signal_names
from motor_sysid.estimation.online.sizes import prior_sigma, Sizes
from motor_sysid.estimation.online.torques import Torques
from motor_sysid.machine_code import kept
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

LOAD = 'constant_load_torque.tau_l'

_RISE = 0.05
"""Time in which the load may go from nothing to the largest torque, s."""
_SMOOTH = 0.02
_MOMENT = 1.0
_TALLEST = 9.0
_KNOWN = 0.5
_USED = 50

_SPEED, _SLOW, _TORQUE, _LATER, _VARIANCE, _COUNT = range(6)


class SlidingMode(OnlineEstimator):
    """Super-twisting observer of the load torque.

    Parameters
    ----------
    model, dt, outputs, tuning:
        See `OnlineEstimator`.

    Attributes
    ----------
    tracker:
        The filter of the motion, for the predictions.

    Raises
    ------
    UserError
        If the model has no free load torque, or a signal of the torque balance is not measured.
    """

    bridges = True

    def __init__(self, model: Model, dt: float, outputs: Sequence[str], tuning: Tuning) -> None:
        if LOAD not in [p.name for p in model.parameters.free]:
            raise UserError(
                'a sliding-mode observer estimates the load torque, which is no free parameter of '
                'the model; add the effect `constant_load_torque`, or use another estimator'
            )
        self._model, self._dt = model, dt
        self._load = model.parameters[LOAD]
        self.tracker = JointFilter(model, dt, outputs, tuning, [])
        self._torques = Torques(model, LOAD)
        self._despiker, self._regressors = Despiker(len(outputs)), Regressors(model, outputs)
        self._regressors.require(self._torques.needs)
        values = {p.name: np.array([p.value]) for p in model.parameters}
        self._regressors.set_dynamics(model.kind.matrices(values)[0][0])
        biases = [o.bias for o in model.kind.outputs if o.bias]
        self._regressors.set_offsets({name: model[name] for name in biases})
        self._omega = signal_names(model.kind).index('omega')
        self._state, size = np.zeros(6), self._torques.size
        self._effects, self._sigma = np.zeros(size), np.zeros(size)
        self._prior, self._limit, self._count, self._fresh = 0.0, 0.0, 0, True
        self._sizes: Sizes | None = None
        _observe(self._state, np.zeros(2), 1.0, 1.0, 0.0, dt)
        self._state[:] = 0.0, 0.0, self._load.value, self._load.value, 0.0, 0.0

    def restart(self, y: Array) -> None:
        """Take up the motion anew; the load stays."""
        self.tracker.restart(y)
        self._regressors.restart(y)
        self._despiker.restart(y)
        self._fresh = True

    def step(self, time: float, h: float, u: Array, y: Array) -> Array:
        """Predict with the present load, then observe."""
        before = self.tracker.state
        predicted = self.tracker.step(time, h, u, y)
        ready = self._despiker.push(Sample(time, h, u, y, before, self.tracker.state))
        if ready is None:
            return predicted
        if not self._regressors.take(ready):
            self._fresh = True
        elif self.tracker.sizes is not None:
            self._observe(ready.length, self.tracker.sizes)
        return predicted

    def _observe(self, h: float, sizes: Sizes) -> None:
        if sizes is not self._sizes:
            self._rescale(sizes)
        measured, tracked = self._regressors.measured, self._regressors.tracked
        speed = measured[:, self._omega]
        if self._fresh:
            self._torques.begin(tracked)
            self._state[_SPEED] = speed[0]
            self._state[_SLOW] = self._state[_TORQUE] / self._torques.inertia
            self._fresh = False
        known = self._torques.known(measured, tracked, h)
        torque = _observe(self._state, speed, known, self._torques.inertia, self._limit, h)
        self._torques.note(known - torque, self._effects, 1.0 - math.exp(-h / _SMOOTH))
        self._count += 1
        if self._count % _USED == 0:
            value = min(max(self._state[_TORQUE], self._load.lower), self._load.upper)
            self.tracker.motion.set_values({LOAD: value})

    def _rescale(self, sizes: Sizes) -> None:
        """Set what follows from the largest input seen."""
        free = Coordinates(self._model.parameters.free)
        spread = prior_sigma(self._model, free.names, sizes, self._dt)
        spread = spread * free.slope(free.vector([p.value for p in free.parameters]))
        table = dict(zip(free.names, spread.tolist(), strict=True))
        forces = [force.name for force in self._model.kind.forces]
        self._limit = float(sizes.force[forces.index('torque')]) / self._torques.inertia / _RISE
        self._prior, self._sigma = table[LOAD], self._torques.spread(table)
        self._sizes = sizes

    def estimate(self) -> dict[str, Estimate]:
        """Return the load torque, and every other free parameter as it was."""
        found = {
            p.name: Estimate(p.value, p.sigma or math.inf, p.unit, False)
            for p in self._model.parameters.free
        }
        if self._sizes is not None:
            value, sigma = float(self._state[_TORQUE]), math.sqrt(self._variance())
            inside = min(max(value, self._load.lower), self._load.upper)
            known = sigma < _KNOWN * self._prior
            found[LOAD] = Estimate(inside, sigma, self._load.unit, known)
        return found

    def _variance(self) -> float:
        """Return the variance of the load: noise, and what the parameters leave open."""
        least = (1e-6 * self._prior) ** 2
        noise = 2.0 * float(self._state[_VARIANCE])
        return least + noise + float(np.sum((self._sigma * self._effects) ** 2))

    def covariance(self) -> Array:
        """Return the (1, 1) variance of the load torque."""
        return np.array([[self._variance()]])


@kept()
def _observe(state, speed, known, inertia, limit, h):  # type: ignore[no-untyped-def]
    """Take a sample; return the torque of the correction.

    Parameters
    ----------
    state:
        (6,) speed of the model, slow part of the correction, load torque, the same smoothed once
        more, the mean square of their difference (half the variance of the load; a step of the
        load counts little), and samples.
    speed:
        (2,) measured speed at both ends.
    known, inertia, limit:
        Known torque, inertia, and how fast the load over the inertia may change.
    """
    slip = state[_SPEED] - 0.5 * (speed[0] + speed[1])
    way = np.sign(slip)
    correction = 1.5 * np.sqrt(limit * abs(slip)) * way + state[_SLOW]
    state[_SLOW] += 1.1 * limit * way * h
    most = _RISE * limit
    state[_SLOW] = min(max(state[_SLOW], -most), most)
    state[_SPEED] += h * (known / inertia - correction)
    torque = inertia * correction
    share = -math.expm1(-h / _SMOOTH)
    state[_TORQUE] += share * (torque - state[_TORQUE])
    state[_LATER] += share * (state[_TORQUE] - state[_LATER])
    off = state[_TORQUE] - state[_LATER]
    state[_COUNT] += 1.0
    usual = state[_VARIANCE]
    far = off * off if state[_COUNT] * h < _MOMENT else min(off * off, _TALLEST * usual)
    state[_VARIANCE] += max(1.0 / state[_COUNT], -math.expm1(-h / _MOMENT)) * (far - usual)
    return torque
