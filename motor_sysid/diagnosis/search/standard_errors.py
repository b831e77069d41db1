"""Standard errors of the last fit, where its derivatives at one place tell too little."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.delay_profile import with_profiled_delays
from motor_sysid.diagnosis.search.edges import beyond_edges, edges_of
from motor_sysid.diagnosis.search.moments import with_honest_moments
from motor_sysid.diagnosis.search.rung import Rung, slopes
from motor_sysid.diagnosis.search.valleys import Around, less_known
from motor_sysid.estimation.batch import FitResult, Problem, Weighting
from motor_sysid.estimation.batch.uncertainty import describe
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

NEAR, POINTS = 0.05, 32
"""Distance in standard errors over which a cost that strikes make rough is looked at, and at how
many points."""

FEW = 1
"""Integration steps per sample in which the cost around a fit is looked at."""


def honest(rung: Rung, bench: Bench, blunt: Array) -> FitResult:
    """Return a fit with standard errors that hold for what the data are like.

    They hold for noise that is correlated for long, for laws that end within reach, for a cost
    that is rough or flatter than its derivatives say, for what signals alone tell, for delays, and
    for moments.  `blunt` (p,) holds errors of the integration that are added to them.
    """
    problem, weighting = bench.problem(rung.model), rung.result.weighting
    near = slopes(rung, bench)
    spread = describe(problem, problem.vector(), weighting, near, stationary=True)
    sigma = beyond_edges(
        problem, weighting, spread.covariance, spread.sigma, spread.information,
        edges_of(rung.model),
    )  # fmt: skip
    scanned = profiled(rung.model)
    own = [p.name in scanned for p in problem.free]
    wider = np.where(own, 1.0, less_known(_around(rung, bench)))
    sigma = np.hypot(np.maximum(sigma, wider * spread.sigma), blunt)
    if any(effect(key).card.strikes for key in rung.model.effects):
        rough = roughness(problem, weighting, spread.covariance)
        sigma = np.hypot(sigma, np.sqrt(rough) * spread.information.bound)
    sigma = within_told(rung.model, bench, sigma, spread.covariance)
    model = rung.model.with_estimates({}, _named(problem, sigma))
    model = with_profiled_delays(model, bench, weighting, spread.information)
    model = with_honest_moments(bench.problem(model), weighting, spread.information)
    return replace(rung.result, model=model, covariance=spread.covariance)


def _around(rung: Rung, bench: Bench) -> Around:
    """Return the cost around a fit, in few steps: only differences between neighbours count."""
    problem, near = bench.problem(rung.model), tuple(slopes(rung, bench))
    return Around(problem.in_steps(FEW, problem.vector()), rung.result.weighting, near)


def within_told(model: Model, bench: Bench, sigma: Array, covariance: Array) -> Array:
    """Return standard errors (p,) with what signals tell of effects whatever the model does.

    A filter that a position beside the speed tells lies in a box that is narrow: no less is known
    of it than that it is anywhere there.  Knowing that helps what is correlated with it, too: a
    delay, of which the speed alone hardly tells it.

    Parameters
    ----------
    model, bench:
        The fitted model, and what the signals show.
    sigma, covariance:
        (p,) standard errors of its free parameters, and (p, p) their covariance.
    """
    free, told = model.parameters.free, sigma.copy()
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    shown = {f'{key}.{effect(key).card.filter}' for key in model.effects if bench.shows(key)}
    for k, p in enumerate(free):
        most = (p.upper - p.lower) / np.sqrt(12.0)
        if p.name not in shown or told[k] <= most:
            continue
        shared = np.clip(covariance[:, k] / (size * size[k]), -1.0, 1.0) ** 2
        told *= np.sqrt(1.0 - shared * (1.0 - (most / told[k]) ** 2))
        told[k] = most
    return told


def profiled(model: Model) -> set[str]:
    """Return the parameters all along which the error is looked at: delays and moments."""
    cards = [(key, effect(key).card) for key in model.effects]
    return {f'{key}.{name}' for key, card in cards for name in (card.delay, card.moment) if name}


def _named(problem: Problem, sigma: Array) -> dict[str, float]:
    return {p.name: float(s) for p, s in zip(problem.free, sigma, strict=True)}


def roughness(problem: Problem, weighting: Weighting, covariance: Array) -> float:
    """Return how much the weighted sum of squares differs between neighbours of a fit.

    Where teeth strike, a little more or less of anything moves every later blow, and a fit ends in
    one of many pits.  It may end as far away as the smooth rise of the cost equals their depth.

    Parameters
    ----------
    problem, weighting:
        The fitted model with the data, and the noise model.
    covariance:
        (p, p) covariance of its parameters.
    """
    z = problem.vector()
    size = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, np.newaxis] * vectors * np.sqrt(np.maximum(values, 0.0))
    away = np.random.default_rng(0).standard_normal((POINTS, z.size)) @ root.T
    lower, upper = problem.box()
    cloud = np.clip(z + NEAR * away / problem.slope(z), lower, upper)
    costs = problem.costs(cloud, weighting, problem.linearize(z, parameters=False))
    sound = costs[np.isfinite(costs)]
    return float(np.std(sound)) if sound.size > 1 else 0.0
