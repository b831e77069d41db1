"""Recursive least squares with forgetting on state-variable-filtered signals.

Each balance of the motor kind is one regression; effects add their laws as regressors.  A raw
difference equation would be useless under sensor noise: the filter passes what moves the motor and
stops most of the noise.  A filter of the motion alone, with these parameters, makes the
predictions.
"""

from collections.abc import Sequence
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.base import Estimate, OnlineEstimator, Tuning
from motor_sysid.estimation.online.coordinates import Coordinates
from motor_sysid.estimation.online.despike import Despiker, Sample
from motor_sysid.estimation.online.ekf import Ekf
from motor_sysid.estimation.online.equation import Equation, offsets
from motor_sysid.estimation.online.regressors import End, Regressors
from motor_sysid.estimation.online.sizes import prior_sigma, Sizes
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]
Found = dict[str, tuple[float, float, float]]

_SLOWEST, _FASTEST = 0.02, 0.15
_KNOWN = 0.5
_TRACKED = 50
_REACH = 20.0


class Rls(OnlineEstimator):
    """Regressions of every balance, and a filter of the motion for the predictions.

    Parameters
    ----------
    model, dt, outputs, tuning:
        See `OnlineEstimator`.

    Raises
    ------
    UserError
        If a signal that an equation needs is not measured.
    """

    def __init__(self, model: Model, dt: float, outputs: Sequence[str], tuning: Tuning) -> None:
        self.model, self._dt = model, dt
        self._balances = model.kind.balances
        biases = [o.bias for o in model.kind.outputs if o.bias and model.parameters[o.bias].free]
        self._tracker = Ekf(model, dt, outputs, tuning, biases)
        width = tuning.bandwidth or _bandwidth(model, dt)
        chosen = zip(self._balances, offsets(model, self._balances), strict=True)
        self._equations = [
            Equation(model, balance, offset, dt, width, tuning.memory)
            for balance, offset in chosen
        ]
        self._despiker, self._regressors = Despiker(len(outputs)), Regressors(model, outputs)
        self._regressors.require(set().union(*(e.needs() for e in self._equations)))
        self._sizes: Sizes | None = None
        self._prior: dict[str, float] = {}
        self._found: Found = {}
        self._count, self._fresh = 0, True
        self._use({})

    def restart(self, y: Array) -> None:
        """Take up the motion anew; what was learned stays."""
        self._tracker.restart(y)
        self._regressors.restart(y)
        self._despiker.restart(y)
        self._fresh = True

    def step(self, time: float, h: float, u: Array, y: Array) -> Array:
        """Predict with the present parameters, then learn from the sample."""
        before = self._tracker.state
        predicted = self._tracker.step(time, h, u, y)
        sample = self._despiker.push(Sample(time, h, u, y, before, self._tracker.state))
        if sample:
            self._take(sample)
        return predicted

    def _take(self, sample: Sample) -> None:
        known = {name: found[0] for name, found in self._found.items()}
        pair = self._regressors.take(sample, known)
        if pair is None:
            self._fresh = True
            return
        if self._fresh:
            for equation in self._equations:
                equation.restart(pair[0])
            self._fresh = False
        self._learn(*pair, sample.length)

    def _learn(self, first: End, last: End, h: float) -> None:
        sizes = self._tracker.sizes
        if sizes is None:
            return
        if sizes is not self._sizes:
            self._sizes, self._prior = sizes, _prior(self.model, sizes, self._dt)
        for equation, balance in zip(self._equations, self._balances, strict=True):
            drive = self._drive(balance.drive.parameter, self._found)[0]
            equation.step(first, last, h, drive, self._prior)
        self._count += 1
        if self._count % _TRACKED == 0:
            self._found = self._gather()
            self._use(self._settled())

    def _use(self, values: dict[str, float]) -> None:
        """Predict and interpolate with these parameters."""
        self._tracker.motion.set_values(values)
        table = {**self.model.parameters.values(), **values}
        a = self.model.kind.matrices({name: np.array([v]) for name, v in table.items()})[0][0]
        self._regressors.set_rates(dict(zip(self.model.kind.states, -np.diag(a), strict=True)))

    def _drive(self, name: str, found: Found) -> tuple[float, float]:
        """Return value and standard deviation of a drive's parameter."""
        if not name:
            return 1.0, 0.0
        if name not in found:
            return self.model[name], 0.0
        return self._inside(name, found[name][0]), found[name][1]

    def _gather(self) -> Found:
        """Return what the equations know now."""
        found: Found = {}
        for equation, balance in zip(self._equations, self._balances, strict=True):
            found.update(equation.found(self._drive(balance.drive.parameter, found)))
        return found

    def _settled(self) -> dict[str, float]:
        """Return the parameters that are known well enough to predict with."""
        return {
            name: self._inside(name, value)
            for name, (value, sigma, prior) in self._found.items()
            if sigma < _KNOWN * prior
        }

    def _inside(self, name: str, value: float) -> float:
        """Return the value in its box, and no absurd one of what must be positive."""
        p = self.model.parameters[name]
        lower, upper = p.lower, p.upper
        if Coordinates([p]).log[0]:
            lower, upper = max(lower, p.value / _REACH), min(upper, p.value * _REACH)
        return min(max(value, lower), upper)

    def estimate(self) -> dict[str, Estimate]:
        """Return the free parameters; those that no equation holds are as they were."""
        found, result = self._gather(), {}
        for p in self.model.parameters.free:
            if p.name in found:
                value, sigma, prior = found[p.name]
                inside = min(max(value, p.lower), p.upper)
                known = sigma < _KNOWN * prior and inside == value
                result[p.name] = Estimate(inside, sigma, p.unit, known)
            else:
                result[p.name] = Estimate(p.value, p.sigma or math.inf, p.unit, False)
        return result

    def covariance(self) -> Array:
        """Return the covariance of all coefficients, equation by equation."""
        parts = [equation.covariance() for equation in self._equations]
        size = sum(len(part) for part in parts)
        whole, at = np.zeros((size, size)), 0
        for part in parts:
            whole[at : at + len(part), at : at + len(part)] = part
            at += len(part)
        return whole


def _prior(model: Model, sizes: Sizes, dt: float) -> dict[str, float]:
    """Return the standard deviation of every free parameter before any data."""
    free = Coordinates(model.parameters.free)
    values = free.vector([p.value for p in free.parameters])
    sigma = prior_sigma(model, free.names, sizes, dt) * free.slope(values)
    return dict(zip(free.names, sigma.tolist(), strict=True))


def _bandwidth(model: Model, dt: float) -> float:
    """Return the mean of the fastest and slowest time constant, as far as sampling allows."""
    values = {p.name: np.array([p.value]) for p in model.parameters}
    rates = np.abs(np.linalg.eigvals(model.kind.matrices(values)[0][0]))
    rates = rates[rates > 1e-9]
    middle = math.sqrt(float(rates.min()) * float(rates.max())) if rates.size else 0.0
    return min(max(middle, _SLOWEST / dt), _FASTEST / dt)
