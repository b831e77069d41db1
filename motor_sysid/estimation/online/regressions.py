"""The balances of a motor as recursive regressions, fed with samples and a filter's states."""

from collections.abc import Mapping, Sequence
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.base import Estimate, Tuning
from motor_sysid.estimation.online.coordinates import Coordinates
from motor_sysid.estimation.online.despike import Despiker, Sample
from motor_sysid.estimation.online.equation import Equation, offsets
from motor_sysid.estimation.online.learners.base import Learner
from motor_sysid.estimation.online.regressors import Regressors
from motor_sysid.estimation.online.sizes import prior_sigma, Sizes
from motor_sysid.physics.model import Model
from motor_sysid.physics.parameters import Parameter

Array = NDArray[np.float64]
Found = dict[str, tuple[float, float, float]]

_SLOWEST, _FASTEST = 0.02, 0.15
_KNOWN = 0.5
_GATHERED, _USED = 50, 10
"""What the equations know is asked every 50 samples and used 10 samples later: both cost time."""
_REACH = 20.0


class Regressions:
    """Every balance of a motor as one regression, and what they say together.

    Parameters
    ----------
    model, dt, outputs, tuning:
        See `motor_sysid.estimation.online.base.OnlineEstimator`.
    learner:
        The rule by which each equation learns.

    Attributes
    ----------
    used:
        Parameters that are known well enough to predict with; renewed every 50 samples.

    Raises
    ------
    UserError
        If a signal that an equation needs is not measured.
    """

    def __init__(
        self,
        model: Model,
        dt: float,
        outputs: Sequence[str],
        tuning: Tuning,
        learner: type[Learner],
    ) -> None:
        self.model, self._dt = model, dt
        self._balances = model.kind.balances
        width = tuning.bandwidth or filter_bandwidth(model, dt)
        chosen = zip(self._balances, offsets(model, self._balances), strict=True)
        self._equations = [
            Equation(model, balance, offset, dt, width, tuning.memory, learner)
            for balance, offset in chosen
        ]
        self._despiker, self._regressors = Despiker(len(outputs)), Regressors(model, outputs)
        self._regressors.require(set().union(*(e.needs() for e in self._equations)))
        self._sizes: Sizes | None = None
        self._prior: dict[str, float] = {}
        self._found: Found = {}
        self._count, self._fresh = 0, True
        self._boxes = {p.name: _sensible_box(p) for p in model.parameters}
        self.used: dict[str, float] = {}
        self._drives = [1.0] * len(self._balances)
        self._use({})

    def restart(self, y: Array) -> None:
        """Take up the motion anew; what was learned stays."""
        self._regressors.restart(y)
        self._despiker.restart(y)
        self._fresh = True

    def set_sensors(self, known: Mapping[str, float]) -> None:
        """Set the present estimates of parameters that only laws of sensors read."""
        self._regressors.set_sensors(known)

    def push(self, sample: Sample, sizes: Sizes | None) -> bool:
        """Take a sample; `sizes` are those seen so far, None before any input.

        Returns
        -------
        Whether `used` was renewed.
        """
        ready = self._despiker.push(sample)
        if ready is None:
            return False
        if not self._regressors.take(ready):
            self._fresh = True
            return False
        if self._fresh:
            for equation in self._equations:
                equation.restart(self._regressors.measured[0], self._regressors.tracked[0])
            self._fresh = False
        return sizes is not None and self._learn(ready.length, sizes)

    def _learn(self, h: float, sizes: Sizes) -> bool:
        if sizes is not self._sizes:
            self._sizes, self._prior = sizes, _prior(self.model, sizes, self._dt)
        measured, tracked = self._regressors.measured, self._regressors.tracked
        for equation, drive in zip(self._equations, self._drives, strict=True):
            equation.step(measured, tracked, h, drive, self._prior)
        self._count += 1
        phase = self._count % _GATHERED
        if phase == 0:
            self._found = self._gather()
        if phase != _USED or not self._found:
            return False
        self._use(self.settled(self._found))
        return True

    def _use(self, found: Mapping[str, tuple[float, float]]) -> None:
        """Predict and interpolate with these parameters."""
        self.used = {name: self._inside(name, value) for name, (value, _) in found.items()}
        table = {**self.model.parameters.values(), **self.used}
        a = self.model.kind.matrices({name: np.array([v]) for name, v in table.items()})[0][0]
        self._regressors.set_dynamics(a)
        self._regressors.set_offsets({name: value for name, (value, *_) in self._found.items()})
        for equation in self._equations:
            equation.give(self.used)
        names = [balance.drive.parameter for balance in self._balances]
        self._drives = [self._drive(name, self._found)[0] for name in names]

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
            for name, one in equation.found(self._drive(balance.drive.parameter, found)).items():
                found[name] = together(found[name], one) if name in found else one
        return found

    def settled(self, found: Found | None = None) -> dict[str, tuple[float, float]]:
        """Return value and sigma of the parameters that are much better known than before."""
        return {
            name: (value, sigma)
            for name, (value, sigma, prior) in (found or self._gather()).items()
            if sigma < _KNOWN * prior
        }

    def _inside(self, name: str, value: float) -> float:
        """Return the value in its box, and no absurd one of what must be positive."""
        lower, upper = self._boxes[name]
        return min(max(value, lower), upper)

    def estimate(self) -> dict[str, Estimate]:
        """Return the free parameters; those that no equation holds are as they were."""
        found, result = self._gather(), {}
        for p in self.model.parameters.free:
            if p.name in found:
                value, sigma, prior = found[p.name]
                inside = min(max(value, p.lower), p.upper)
                least = min(prior, inside) if p.logarithmic else prior
                known = sigma < _KNOWN * least and inside == value
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


def together(
    one: tuple[float, float, float], other: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return value, sigma and prior of a parameter that two equations tell."""
    weights = [1.0 / max(sigma, 1e-300) ** 2 for _, sigma, _ in (one, other)]
    value = (weights[0] * one[0] + weights[1] * other[0]) / sum(weights)
    return value, 1.0 / math.sqrt(sum(weights)), min(one[2], other[2])


def _sensible_box(p: Parameter) -> tuple[float, float]:
    if Coordinates([p]).log[0]:
        return max(p.lower, p.value / _REACH), min(p.upper, p.value * _REACH)
    return p.lower, p.upper


def _prior(model: Model, sizes: Sizes, dt: float) -> dict[str, float]:
    """Return the standard deviation of every free parameter before any data."""
    free = Coordinates(model.parameters.free)
    values = free.vector([p.value for p in free.parameters])
    sigma = prior_sigma(model, free.names, sizes, dt) * free.slope(values)
    return dict(zip(free.names, sigma.tolist(), strict=True))


def filter_bandwidth(model: Model, dt: float) -> float:
    """Return the mean of the fastest and slowest time constant, as far as sampling allows."""
    values = {p.name: np.array([p.value]) for p in model.parameters}
    rates = np.abs(np.linalg.eigvals(model.kind.like(values)[0][0]))
    rates = rates[rates > 1e-9]
    middle = math.sqrt(float(rates.min()) * float(rates.max())) if rates.size else 0.0
    return min(max(middle, _SLOWEST / dt), _FASTEST / dt)
