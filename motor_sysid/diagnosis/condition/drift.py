"""How far a motor's parameters have moved from a reference model, and whether by chance.

Positive parameters are compared by their logarithm, others by their value over the reference's.
A difference has the variance of the estimate, of the reference, and of what healthy motors do from
one day to the next (`scatter`).  Many parameters are looked at, on many days: Holm's step-down
test keeps the chance of any false alarm among all of them below `alpha`.
(Holm, Scandinavian Journal of Statistics 6, 1979, 65-70.)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from motor_sysid.estimation.batch import FitResult
from motor_sysid.estimation.batch.sisters import of_the_motor
from motor_sysid.physics.model import Model
from motor_sysid.physics.parameters import Parameter

Array = NDArray[np.float64]

SCATTER = 0.02
"""Relative standard deviation of a healthy motor's parameters from day to day."""

FREEDOM = 100
"""Degrees of freedom of a standard deviation: blocks of a record less parameters."""


_LEAST = 1e-16


@dataclass(frozen=True)
class Drift:
    """Differences of p parameters from the reference.

    Attributes
    ----------
    parameters:
        The parameters, as the reference has them.
    values:
        (p,) their values now, in SI.
    change:
        (p,) relative difference: of logarithms for positive parameters.
    covariance:
        (p, p) of the change.
    """

    parameters: tuple[Parameter, ...]
    values: Array
    change: Array
    covariance: Array

    @property
    def sigma(self) -> Array:
        """(p,) standard deviation of the change."""
        return np.sqrt(np.diag(self.covariance))

    def p_values(self) -> Array:
        """Return (p,) how often each change comes about by chance."""
        found: Array = 2 * student.sf(np.abs(self.change) / self.sigma, FREEDOM)
        return found

    def percent(self, k: int) -> float:
        """Return the k-th change in percent of the reference."""
        one = self.parameters[k]
        return 100 * (float(self.values[k]) / one.value - 1) * (1 if one.value > 0 else -1)

    def words(self, k: int) -> str:
        """Return the k-th change in words."""
        size = 100 * float(self.sigma[k]) * (1 + abs(self.percent(k)) / 100)
        return f'{self.parameters[k].name} {self.percent(k):+.3g} ± {size:.2g} %'


def watched(reference: Model) -> tuple[Parameter, ...]:
    """Return the parameters of a reference that tell of a motor's condition.

    Free ones of the motor itself, with a value that is known and not zero.
    """
    return tuple(
        p
        for p in of_the_motor(reference)
        if p.value != 0 and (p.sigma is None or np.isfinite(p.sigma))
    )


def drift_of_fit(reference: Model, fit: FitResult, scatter: float = SCATTER) -> Drift:
    """Return how far a refit of the reference has moved."""
    free = [p.name for p in fit.model.parameters.free]
    now = {p.name: p for p in fit.model.parameters}
    wanted = [p for p in watched(reference) if np.isfinite(now[p.name].sigma or 0.0)]
    rows = [free.index(p.name) for p in wanted]
    values = np.array([fit.model[p.name] for p in wanted])
    return _drift(wanted, values, fit.covariance[np.ix_(rows, rows)], scatter)


def drift_of_estimates(
    reference: Model,
    estimates: Mapping[str, tuple[float, float, str, bool]],
    scatter: float = SCATTER,
) -> Drift:
    """Return how far live estimates have moved: parameter to value, sigma, unit, identifiable."""
    known = {name for name, one in estimates.items() if one[3] and np.isfinite(one[:2]).all()}
    wanted = [p for p in watched(reference) if p.name in known]
    values, sigmas = (np.array([estimates[p.name][k] for p in wanted]) for k in (0, 1))
    return _drift(wanted, values, np.diag(np.square(sigmas)), scatter)


def _drift(
    wanted: Sequence[Parameter], values: Array, covariance: Array, scatter: float
) -> Drift:
    before = np.array([p.value for p in wanted])
    log = np.array([p.logarithmic for p in wanted], dtype=bool)
    scale = np.where(log, values, np.abs(before))
    change = np.where(log, np.log(np.maximum(values, 1e-300) / np.abs(before)),
                      (values - before) / np.abs(before))  # fmt: skip
    own = np.array([(p.sigma or 0.0) / abs(p.value) for p in wanted])
    spread = covariance / np.outer(scale, scale) + np.diag(own**2 + scatter**2 + _LEAST)
    return Drift(tuple(wanted), values, change, spread)


def alarms(drifts: Sequence[Drift], alpha: float) -> list[list[int]]:
    """Return for each drift the parameters that have moved, by their numbers.

    The chance of any false alarm among all of them is at most `alpha`.
    """
    flat = [(p, n, k) for n, one in enumerate(drifts) for k, p in enumerate(one.p_values())]
    found: list[list[int]] = [[] for _ in drifts]
    for rank, (p, n, k) in enumerate(sorted(flat)):
        if not p <= alpha / (len(flat) - rank):
            break
        found[n].append(k)
    return [sorted(one) for one in found]
