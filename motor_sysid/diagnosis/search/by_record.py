"""A parameter, or the strength of the input, that is not the same in all records.

A battery that is emptier than reckoned with, a winding that is warmer, another payload, a sensor
that was set to zero anew: within a record nothing is missing, but no model has the same parameters
in all of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.candidates.left_noise import left_noise
from motor_sysid.diagnosis.search.may_differ import Direction, directions, with_own
from motor_sysid.estimation.batch import (
    fit_and_slopes,
    Linearization,
    Problem,
    Weighting,
    white,
)
from motor_sysid.estimation.batch.chains import Chain
from motor_sysid.estimation.batch.least_squares import newton_step, normal_equations
from motor_sysid.physics.model import Model
from motor_sysid.physics.scales import Scales

Array = NDArray[np.float64]

CERTAIN = 600.0
"""Evidence (gain in BIC) from which on records differ: what is missing makes them seem to, a
little.  Effects that were taken out of the catalogue had 118, 122 and 394; what differs, 1004 at
least, beside cogging that was not known."""

MATTERS = 0.005
"""Relative difference from which on it is told; temperature alone makes a resistance differ more.
Of what may be zero it is that which changes an output by so much of its root mean square."""


@dataclass(frozen=True)
class Differing:
    """What differs from record to record.

    Attributes
    ----------
    name:
        Of the parameter, or `INPUT`, whose value is 1 in the first record.
    values, sigmas:
        (n,) its value in each record, and the standard error of how far that is from the first
        one's; NaN for records that were not compared.
    relative:
        Whether it is never zero, so that people speak of percents.
    least:
        Difference that is worth telling.
    delta_bic:
        Gain in BIC against the same value in all.
    share:
        Of the squared error, what goes with it.
    model:
        Fitted to all records.
    left:
        (n, n_y) error that is left of each record with its own value, root mean square; empty
        where that was not fitted.
    """

    name: str
    values: Array
    sigmas: Array
    relative: bool
    least: float
    delta_bic: float
    share: float
    model: Model
    left: Array = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def matters(self) -> bool:
        """Whether it is certain, and not too little to speak of."""
        off = np.abs(self.values - self.values[0])
        seen = off > np.maximum(self.least, 3.0 * self.sigmas)
        return self.delta_bic > CERTAIN and bool(np.any(seen))


def differing(
    model: Model,
    chains: Sequence[Chain],
    outputs: Sequence[str],
    substeps: int = 1,
    scales: Scales | None = None,
) -> Differing | None:
    """Return what differs most clearly between records; None if there is only one.

    Every parameter of the motor, every size of an effect, the input, a load and an offset of a
    tachometer are given a value of their own in each record, all other parameters at their best:
    one step of Gauss and Newton from where the model fits all of them.

    Parameters
    ----------
    model:
        The model, which is fitted to all records first.
    chains:
        One for each record.
    outputs, substeps:
        See `Problem`.
    scales:
        Sizes of the signals.
    """
    if len(chains) < 2:
        return None
    result, near = fit_and_slopes(
        Problem(model, chains, outputs, substeps=substeps), reweight=1, iterations=10
    )
    problem = Problem(result.model, chains, outputs, substeps=substeps)
    owner = [k for k, chain in enumerate(chains) for stretch in chain if stretch.scored]
    several = [*directions(problem, near, scales)]
    own = [_by_record(one, owner, len(chains)) for one in several]
    weighting = _noise(problem, near, own)
    rows = float(np.sum(problem.fresh)) * sum(len(part.residual) for part in near)
    found = []
    for one, columns in zip(several, own, strict=True):
        known = _wider(near, [c[..., :1] for c in columns]) if one.joins else near
        wide = _wider(known, [c[..., 1:] for c in columns])
        now, (cost, step, sigma) = _cost(known, weighting)[0], _cost(wide, weighting)
        others = len(chains) - 1
        if np.all(np.isfinite(step[-others:])):
            gain, share = now - cost - others * np.log(rows), _share(problem, wide, step)
            values, sigmas = _in_each(one, step, sigma, others)
            least = _least(one, problem, values[0])
            found.append(
                Differing(
                    one.name, values, sigmas, one.logarithmic, least, gain, share, result.model
                )
            )
    return max(found, key=lambda one: one.delta_bic, default=None)


def _in_each(one: Direction, step: Array, sigma: Array, others: int) -> tuple[Array, Array]:
    """Return the values (n,) in all records, and standard errors of their differences."""
    common = -others - 1 if one.joins else one.common
    first = 0.0 if common is None else step[common]
    values = one.values(first + np.append(0.0, step[-others:]))
    sigmas = (values if one.logarithmic else one.unit) * np.append(0.0, sigma[-others:])
    return values, np.abs(sigmas)


def _least(one: Direction, problem: Problem, value: float) -> float:
    """Return the difference that is worth telling, in the unit of the value."""
    if one.logarithmic:
        return MATTERS * abs(value)
    pairs = zip(one.columns, problem.stretches, strict=True)
    squares = [(np.sum(c**2, axis=0), np.sum(s.judged**2, axis=0)) for c, s in pairs]
    changed, size = (np.sum(part, axis=0) for part in zip(*squares, strict=True))
    most = float(np.sqrt(np.max(changed / np.maximum(size, 1e-300))))
    return MATTERS * abs(one.unit) / max(most, 1e-300)


def measured_by(
    one: Differing,
    model: Model,
    chains: Sequence[Chain],
    outputs: Sequence[str],
    substeps: int,
    scales: Scales | None = None,
) -> Differing:
    """Return a difference as a model tells it that fits: its parameter fitted to each record."""
    alone = with_own(model, one.name, scales)
    found = [fit_and_slopes(Problem(alone, [c], outputs, substeps=substeps)) for c in chains]
    there = [result.model.parameters[one.name] for result, _ in found]
    errors_left = [white([part.residual for part in near]).sigma for _, near in found]
    values = np.array([p.value for p in there])
    errors = np.array([p.sigma if p.sigma is not None else np.inf for p in there])
    of_first = errors[0] * (values / values[0] if one.relative else 1.0)
    sigmas = np.hypot(errors, of_first)
    sigmas[0] = 0.0
    return replace(
        one, values=values, sigmas=sigmas, model=found[0][0].model, left=np.array(errors_left)
    )


def _by_record(one: Direction, owner: Sequence[int], count: int) -> list[Array]:
    """Return (N, n_y, count) derivatives of each stretch.

    The first is by the value in all records, the others by that of every record but the first.
    """
    found = []
    for column, record in zip(one.columns, owner, strict=True):
        wide = np.zeros((*column.shape, count))
        wide[..., 0] = column
        if record:
            wide[..., record] = column
        found.append(wide)
    return found


def _wider(near: Sequence[Linearization], columns: Sequence[Array]) -> list[Linearization]:
    """Return derivatives with further ones behind them."""
    return [
        replace(part, slope=np.concatenate((part.slope, more), axis=2))
        for part, more in zip(near, columns, strict=True)
    ]


def _noise(
    problem: Problem, near: Sequence[Linearization], own: Sequence[Sequence[Array]]
) -> Weighting:
    """Return the noise that is left where every parameter has its own value in each record."""
    raw = [
        np.concatenate((one.residual[..., np.newaxis], one.slope, *extra), axis=2)
        for one, *extra in zip(near, *own, strict=True)
    ]
    plain = white([problem.settled(one, white([one.residual for one in near])) for one in near])
    return left_noise(problem, raw, [one.start for one in near], plain)


def _cost(near: Sequence[Linearization], weighting: Weighting) -> tuple[float, Array, Array]:
    """Return the whitened sum of squares at the nearest minimum, the step there, its errors."""
    gradient, curvature, cost = normal_equations(near, weighting)
    step = newton_step(gradient, curvature)
    spread = np.diag(np.linalg.pinv(curvature, rcond=1e-12, hermitian=True))
    return cost - float(step @ gradient), step, np.sqrt(np.maximum(spread, 0.0))


def _share(problem: Problem, near: Sequence[Linearization], step: Array) -> float:
    """Return the share of the squared error, all outputs alike, that goes with a step."""
    size = np.std(np.concatenate([s.judged for s in problem.stretches]), axis=0)
    before = np.concatenate([one.residual for one in near]) / size
    after = np.concatenate([one.residual - one.slope @ step for one in near]) / size
    return max(0.0, 1.0 - float(np.sum(after**2) / max(np.sum(before**2), 1e-300)))
