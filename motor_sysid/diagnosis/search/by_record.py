"""A parameter of the motor, or the strength of its input, that is not the same in all records.

A battery that is emptier than reckoned with, a winding that is warmer, another payload: within a
record nothing is missing, but no model has the same parameters in all of them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.candidates.left_noise import left_noise
from motor_sysid.diagnosis.where.other_values import slopes_by_input
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

Array = NDArray[np.float64]

INPUT = 'input'
"""In place of a parameter's name: what all inputs are multiplied by."""

CERTAIN = 600.0
"""Evidence (gain in BIC) from which on records differ: what is missing makes them seem to, a
little.  Effects that were taken out of the catalogue had 118, 122 and 394; what differs, 1004 at
least, beside cogging that was not known."""

MATTERS = 0.005
"""Relative difference from which on it is told; temperature alone makes a resistance differ more.
"""


@dataclass(frozen=True)
class Differing:
    """What differs from record to record.

    Attributes
    ----------
    name:
        Of the parameter, or `INPUT`.
    factors, sigmas:
        (n,) what it is multiplied by in each record against the first, and the standard error of
        that; NaN for records that were not compared.
    delta_bic:
        Gain in BIC against the same value in all.
    share:
        Of the squared error, what goes with it.
    model:
        Fitted to all records; its parameters are those of the first.
    left:
        (n, n_y) error that is left of each record with its own value, root mean square; empty
        where that was not fitted.
    """

    name: str
    factors: Array
    sigmas: Array
    delta_bic: float
    share: float
    model: Model
    left: Array = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def matters(self) -> bool:
        """Whether it is certain, and not too little to speak of."""
        off = np.abs(self.factors - 1.0)
        seen = off > np.maximum(MATTERS, 3.0 * self.sigmas)
        return self.delta_bic > CERTAIN and bool(np.any(seen))


def differing(
    model: Model, chains: Sequence[Chain], outputs: Sequence[str], substeps: int = 1
) -> Differing | None:
    """Return what differs most clearly between records; None if there is only one.

    Every base parameter that must be positive, and the input, is given a value of its own in each
    record, all other parameters at their best: one step of Gauss and Newton from where the model
    fits all of them.

    Parameters
    ----------
    model:
        The model, which is fitted to all records first.
    chains:
        One for each record.
    outputs, substeps:
        See `Problem`.
    """
    if len(chains) < 2:
        return None
    result, near = fit_and_slopes(
        Problem(model, chains, outputs, substeps=substeps), reweight=1, iterations=10
    )
    problem = Problem(result.model, chains, outputs, substeps=substeps)
    owner = [k for k, chain in enumerate(chains) for stretch in chain if stretch.scored]
    own = [
        (name, [_by_record(c, k, len(chains)) for c, k in zip(columns, owner, strict=True)])
        for name, columns in _directions(problem, near)
    ]
    weighting = _noise(problem, near, [columns for _, columns in own])
    now = _cost(near, weighting)[0]
    rows = float(np.sum(problem.fresh)) * sum(len(one.residual) for one in near)
    found = []
    for name, columns in own:
        wider = [
            replace(one, slope=np.concatenate((one.slope, extra), axis=2))
            for one, extra in zip(near, columns, strict=True)
        ]
        cost, step, sigma = _cost(wider, weighting)
        gain = now - cost - (len(chains) - 1) * np.log(rows)
        own_step, own_sigma = (np.append(0.0, x[-(len(chains) - 1) :]) for x in (step, sigma))
        if np.all(np.isfinite(own_step)):
            factors = np.exp(np.clip(own_step, -2.0, 2.0))
            share = _share(problem, wider, step)
            found.append(
                Differing(name, factors, factors * own_sigma, gain, share, result.model)
            )
    return max(found, key=lambda one: one.delta_bic, default=None)


def measured_by(
    one: Differing, model: Model, chains: Sequence[Chain], outputs: Sequence[str], substeps: int
) -> Differing:
    """Return a difference as a model tells it that fits: its parameter fitted to each record."""
    alone = model.with_free([p.name for p in model.parameters.free], free=False)
    alone = alone.with_free([one.name])
    found = [fit_and_slopes(Problem(alone, [c], outputs, substeps=substeps)) for c in chains]
    there = [result.model.parameters[one.name] for result, _ in found]
    errors_left = [white([part.residual for part in near]).sigma for _, near in found]
    values = np.array([p.value for p in there])
    errors = np.array([p.sigma if p.sigma is not None else np.inf for p in there])
    sigmas = np.hypot(errors / values, errors[0] / values[0]) * values / values[0]
    sigmas[0] = 0.0
    return replace(
        one, factors=values / values[0], sigmas=sigmas, model=found[0][0].model,
        left=np.array(errors_left),
    )  # fmt: skip


def _directions(
    problem: Problem, near: Sequence[Linearization]
) -> Iterator[tuple[str, list[Array]]]:
    """Yield what may differ, and (N, n_y) derivatives of all stretches by its logarithm."""
    yield INPUT, [slope[..., 0] for slope in slopes_by_input(problem)]
    base = {p.name for p in problem.model.kind.parameters}
    for k, one in enumerate(problem.free):
        if one.name in base and one.logarithmic:
            yield one.name, [part.slope[..., k] for part in near]


def _by_record(column: Array, record: int, count: int) -> Array:
    """Return (N, n_y, count - 1) derivatives by the values of all records but the first."""
    wide = np.zeros((*column.shape, count - 1))
    if record:
        wide[..., record - 1] = column
    return wide


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
