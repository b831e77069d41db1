"""A fitted model, and what is asked of it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.candidates.score import Scored
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.moments import unseen_moments, with_best_moments
from motor_sysid.diagnosis.where.compare import compare, Comparison, comparison_of, likely
from motor_sysid.estimation.batch import (
    Chain,
    fit_and_slopes,
    FitResult,
    Linearization,
    Weighting,
    without_memory,
)
from motor_sysid.estimation.batch.least_squares import newton_step, normal_equations
from motor_sysid.physics.effect import Scale
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.noise import noise_sigmas

Array = NDArray[np.float64]

BRIEF_STEPS = 5
"""Most steps of a fit of a trial, which begins near its end."""

BRIEF, FULL = 1e-5, 1e-7
"""Promised relative decrease of the sum of squares at which a fit of a trial ends, and any other.
"""

FINER = 4
"""Most integration steps per sample while candidates are tried, where one is not enough."""

HOPELESS, STEPS = 1.5, 2
"""Sum of squares with another speed sensor, after so many steps from where the fit is, in units of
what it must come to, from which on no fit is tried.  Where noise is low and a parameter far
off, one step is not all: base parameters make up for a sensor that is not theirs."""

BEATEN = 1.01
"""The same after a brief fit, from which on none in full is tried."""

SPOILED = 1.02
"""Held-out error over what it was, from which on another fit counts for less, whatever its
evidence: a fit in full of what was tried briefly, that ran off along what the training data do not
tell, a fit in which one effect takes the place of another, or one with another speed sensor."""

NOTHING = 1e-2
"""Base parameter over its first guess, below which it counts as fallen to nothing."""

ASTRAY = 0.9
"""Training error of one fit over that of another, below which the other's parameters are astray,
whatever a noise model says that took what is missing for noise."""

LOST = 5.0
"""Held-out error in units of the sensor noise from which on what is missing may pass for noise,
and parameters may be far astray."""

COARSE = 10.0
"""Size that a fit began with, in units of what it came to, from which on its differences tell
nothing: an amplitude of zero has none without the box of its card."""

_FAST = (Scale.RATE, Scale.SAMPLE, Scale.ANGLE)
"""Scales of parameters that tell of a memory that fades within some samples."""


@dataclass(frozen=True)
class Rung:
    """A fitted model with everything that is asked of it.

    Attributes
    ----------
    result:
        The fit.
    training, validation:
        Free-running errors.
    held:
        Errors on held-out data, looking as far ahead as the fit does.
    near:
        Residuals and derivatives over the training data; empty if not kept.
    substeps:
        Integration steps per sample that all this was reckoned with.
    """

    result: FitResult
    training: Comparison
    validation: Comparison
    held: Comparison
    near: tuple[Linearization, ...] = ()
    substeps: int = 1

    @property
    def model(self) -> Model:
        """The fitted model."""
        return self.result.model


def climb(
    model: Model,
    bench: Bench,
    start: Weighting | None = None,
    *,
    briefly: bool = False,
    near: Sequence[Linearization] = (),
) -> Rung:
    """Fit a model on the training data and take its free-running errors.

    A trial fits `briefly`: it is followed by a projection, and the winner is fitted in full.
    `near` holds residuals and derivatives of the model as it is, if they are known; then a brief
    fit takes the noise as `start` has it.
    """
    reweight, iterations = (0 if near else 1, BRIEF_STEPS) if briefly else (3, 30)
    problem = bench.problem(model)
    tolerance = BRIEF if briefly else FULL
    result, near = fit_and_slopes(
        problem, start, reweight=reweight, iterations=iterations, tolerance=tolerance,
        near=problem.adopt(near),
    )  # fmt: skip
    begun = bench.problem(result.model)
    if np.any(problem.size > COARSE * begun.size):
        result, near = fit_and_slopes(
            begun, result.weighting, reweight=reweight, iterations=iterations, tolerance=tolerance
        )
    anew = {} if briefly or not model.effects else lost(result.model, bench)
    if anew:
        other, beside = fit_and_slopes(
            bench.problem(result.model.with_values(anew)), result.weighting, reweight=1,
            iterations=30, tolerance=FULL,
        )  # fmt: skip
        if _cost(beside, result.weighting) < _cost(near, result.weighting):
            result, near = other, beside
    moved = with_best_moments(bench.problem(result.model), result.weighting)
    if moved is not result.model:
        result, near = fit_and_slopes(
            bench.problem(moved), result.weighting, reweight=reweight, iterations=iterations,
            tolerance=tolerance,
        )  # fmt: skip
    if unseen := unseen_moments(result.model):
        held, _ = fit_and_slopes(
            bench.problem(result.model.with_free(unseen, free=False)), result.weighting,
            reweight=reweight, iterations=iterations, tolerance=tolerance,
        )  # fmt: skip
        other, beside = fit_and_slopes(
            bench.problem(held.model.with_free(unseen)), held.weighting, reweight=0, iterations=1
        )
        if _cost(beside, result.weighting) < _cost(near, result.weighting):
            result, near = other, beside
    return judge(result, bench, near)


def lost(model: Model, bench: Bench) -> dict[str, float]:
    """Return base parameters that have fallen to nothing to their first guess, if that is more.

    While an effect is missing, a friction may fall to nothing; from there the fit of its logarithm
    has no slope to climb back.
    """
    return {
        p.name: first
        for p in model.parameters.free
        if p.logarithmic
        and p.value < (first := bench.begun.get(p.name, 0.0)) * (1.0 if p.on_bound else NOTHING)
    }


def _cost(near: Sequence[Linearization], weighting: Weighting) -> float:
    return normal_equations(near, weighting)[2]


def judge(result: FitResult, bench: Bench, near: Sequence[Linearization] = ()) -> Rung:
    """Take the errors of a fitted model; `near` holds its residuals on the training data."""
    outputs, substeps = bench.outputs, bench.substeps
    if near and bench.train_free is bench.train:
        problem = bench.problem(result.model)
        training = comparison_of(likely(near, problem), problem)
    else:
        training = compare(result.model, bench.train_free, outputs, substeps=substeps)
    held = compare(result.model, bench.held, outputs, substeps=substeps)
    free = held
    if bench.held_free is not bench.held:
        free = compare(result.model, bench.held_free, outputs, substeps=substeps)
    return Rung(result, training, free, held, tuple(near), substeps)


def leaves_much(
    rung: Rung, bench: Bench, times: float = LOST, *, beside: Sequence[Array] = ()
) -> bool:
    """Whether the held-out error of a model is so many times the noise in some channel.

    The noise is what the held-out residuals show, or those `beside` them, if these show less: late
    edges look like noise.
    """
    left = np.concatenate(rung.held.residuals)
    seen = [parts for parts in (rung.held.residuals, beside) if parts]
    noise = np.min([noise_sigmas(parts, bench.differenced(rung.model)) for parts in seen], axis=0)
    return bool(np.any(np.sqrt(np.mean(left**2, axis=0)) > times * noise))


def some_of(bench: Bench, model: Model) -> tuple[Chain, ...]:
    """Return some of the training data; all where an effect of the model remembers for long.

    What such an effect does depends on long ago: it cannot be seen in pieces of a record.
    """
    cards = [effect(key).card for key in model.effects]
    lasting = any(
        card.moment or (card.states and not any(p.scale in _FAST for p in card.parameters))
        for card in cards
    )
    if lasting or not bench.rough:
        return bench.train
    return bench.rough if any(card.strikes for card in cards) else without_memory(bench.rough)


def slopes(rung: Rung, bench: Bench) -> Sequence[Linearization]:
    """Return residuals and derivatives of a fitted model over the training data."""
    problem = bench.problem(rung.model)
    if rung.near and rung.substeps == bench.substeps:
        return problem.adopt(rung.near)
    return problem.linearize(problem.vector())


def profile_cost(rung: Rung, bench: Bench, weighting: Weighting) -> tuple[float, int]:
    """Return the whitened sum of squares at the nearest minimum, and of how many errors.

    Those that a noise model takes to begin with, and those that open starts fit, do not count.
    """
    near = slopes(rung, bench)
    gradient, curvature, cost = normal_equations(near, weighting)
    fresh = float(np.mean(bench.problem(rung.model).fresh))
    whole = sum(weighting.rows(len(one.residual)) - one.start.shape[2] for one in near)
    return cost - float(newton_step(gradient, curvature) @ gradient), max(round(fresh * whole), 1)


def with_better_sensor(
    rung: Rung, bench: Bench, weighting: Weighting, scored: Sequence[Scored] = ()
) -> Rung:
    """Return the fit with the speed sensor that the data like better under this noise model.

    An effect could otherwise win by the sensor that was tried with it.  One that is `scored`, and
    that the other sensor has no room for, as counts have none for an offset, may explain what that
    sensor only seems to.  What half a sample does is noise to a noise model of so many samples:
    where one sensor leaves clearly less and the evidence for either is much the same, it is taken.
    """
    best, now = rung, profile_cost(rung, bench, weighting)[0]
    least = now - bench.threshold
    for sensor in bench.other_sensors(rung.model):
        model = rung.model.with_speed_sensor(sensor)
        without = (s for s in scored if s.allowed and not model.admits(s.variant.effect))
        most = min(least, now - max((s.gain for s in without), default=0.0))
        if not within_reach(model, bench, weighting, HOPELESS * most):
            continue
        brief = climb(model, bench, weighting, briefly=True)
        if profile_cost(brief, bench, weighting)[0] > BEATEN * most:
            continue
        other = climb(brief.model, bench, weighting)
        cost = profile_cost(other, bench, weighting)[0]
        clearly = other.training.error_percent < ASTRAY * best.training.error_percent
        if (cost < most or clearly) and np.isfinite(other.held.error_percent):
            best, least = other, min(cost, least)
    return best


def within_reach(model: Model, bench: Bench, weighting: Weighting, most: float) -> bool:
    """Whether some undamped steps from where a model is promise a cost of `most` or less."""
    for _ in range(STEPS):
        problem = bench.problem(model)
        now = problem.vector()
        gradient, curvature, cost = normal_equations(problem.linearize(now), weighting)
        step = newton_step(gradient, curvature)
        if cost - float(step @ gradient) <= most:
            return True
        if not np.all(np.isfinite(step)):
            return False
        model = problem.model_at(np.clip(now + step, *problem.box()))
    return False


def certainty(rung: Rung, key: str) -> float:
    """Return the largest squared ratio of an effect's amplitude to its standard error.

    That is for the effect's shapes as they are: without the effect they mean nothing, and where
    they are hardly known, no amplitude is, though it is certain that there is one.  (Davies 1987,
    doi:10.1093/biomet/74.1.33.)
    """
    free = list(rung.model.parameters.free)
    place = {p.name: k for k, p in enumerate(free)}
    card, spread = effect(key).card, rung.result.covariance
    shapes = [place[n] for n in (f'{key}.{s.name}' for s in card.shapes) if n in place]
    own = [place[n] for n in (f'{key}.{a.name}' for a in card.amplitudes) if n in place]
    if not np.all(np.isfinite(spread)):
        return 0.0
    mixed = spread[np.ix_(own, shapes)]
    beside = np.linalg.pinv(spread[np.ix_(shapes, shapes)], hermitian=True)
    left = np.diag(spread)[own] - np.einsum('ij,jk,ik->i', mixed, beside, mixed)
    found = [(free[k], float(v)) for k, v in zip(own, left, strict=True)]
    return max((p.value**2 / v for p, v in found if v > 0.0 and not p.on_bound), default=0.0)
