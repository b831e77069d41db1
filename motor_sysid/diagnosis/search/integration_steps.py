"""Steps of the integration as fine, and smoothed signs as sharp, as the data ask for.

What smoothing and integration do wrong would count as missing physics.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.feedback import unbiased
from motor_sysid.diagnosis.search.pits import deepest
from motor_sysid.diagnosis.search.refit import rough_fit, ROUGH_STEPS
from motor_sysid.diagnosis.search.rung import (
    BRIEF,
    climb,
    FINER,
    judge,
    Rung,
    slopes,
    some_of,
    SPOILED,
)
from motor_sysid.diagnosis.search.standard_errors import honest
from motor_sysid.diagnosis.search.strides import strode
from motor_sysid.diagnosis.search.trial import Trial
from motor_sysid.diagnosis.where.compare import compare
from motor_sysid.estimation.batch import FitResult, Linearization, misfit, Problem, Weighting
from motor_sysid.estimation.batch.least_squares import (
    newton_step,
    normal_equations,
    result_at,
    SHORTER,
    Solution,
)
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

FINEST = 16
"""Most integration steps per sample of the last fit, whose parameters are told."""

UTMOST, QUICK = 64, 0.5
"""The same where many waves of a ripple pass within a sample: more than these radians in one of
`FINEST` steps, at the root mean square of the speed."""

MOVE = 0.25
"""Move of a parameter that is worth no finer steps, in standard errors."""

SHARPER = 8
"""How much narrower smoothed signs are tried; the bias that they make is in proportion."""

WIDTHS = ('omega_eps', 'i_eps')
"""Widths of smoothed signs."""

CHORDS = 8
"""Most steps with the same derivatives."""

LEAST_BEND = 1e-2
"""Fall of a gradient along a step, in units of what was expected, that tells a curvature."""

FINER_BY = 8
"""How much finer steps must change nothing, so that steps are fine enough."""

JUDGE = 4
"""How much finer than the most that are allowed those steps are by which the others are judged."""

NEARER = 0.5
"""Error of finer steps, in units of that of coarser ones, from which on they are not worth it: it
falls with the square of their length where nothing strikes."""

KEPT_RUNS = 8
"""Runs in the finest steps that are kept: a long record makes large ones."""

BLUNT = 0.02
"""Error of blunt signs, as a share of what is left, that is not worth sharper ones."""

ROUNDING, WRONG = 0.1, 0.3
"""Error of the integration, as a share of what is left, that is not worth finer steps; and the
same where they would be many."""


def refined(rung: Rung, bench: Bench) -> tuple[Rung, Bench]:
    """Refit with sharper signs and finer steps of the integration where they matter.

    What smoothing and integration do would count as missing physics; it may be a tenth of the
    remaining error.  Some of the data tell, and a better fit to them may ask for more.  What even
    these steps do wrong is noted.
    """
    some = replace(bench, train=some_of(bench, rung.model))
    sharp, _ = _sharpened(rung.model, some, _like)
    steps, right = _fine_enough(rung.model, some)
    if sharp is rung.model and steps == some.substeps:
        return rung, replace(bench, wrong=0.0 if right else _wrong(rung, some))
    found, steps, right = _fitted(sharp, rung.result.weighting, some)
    if sharp is not rung.model:
        again = replace(some, substeps=steps)
        other = _fitted(rung.model, rung.result.weighting, again)
        if misfit(other[0]) < misfit(found):
            found, steps, right = other
    rung = climb(found.model, replace(bench, substeps=steps), found.weighting, briefly=True)
    wrong = 0.0 if right else _wrong(rung, replace(some, substeps=steps))
    return rung, replace(bench, substeps=steps, wrong=wrong)


def asked_finer(rung: Rung, tried: Sequence[Trial], bench: Bench) -> tuple[Rung, Bench]:
    """Return a fit in steps as fine as what was tried on it asks for, if that takes finer ones.

    Coarse ones follow a law that bends within a sample, that of a dead time say, so badly that
    held-out data refuse it.  Of a wave that passes within a step they see little.
    """
    most = bench.substeps
    for trial in tried:
        model = trial.rung.model
        most = max(most, _fine_enough(model, replace(bench, train=some_of(bench, model)))[0])
        fast = _ripples(model, bench)
        radians = fast / most if fast > _ripples(rung.model, bench) else 0.0
        while radians > 2 * QUICK and most < UTMOST:
            most, radians = 2 * most, radians / 2
    if most == bench.substeps:
        return rung, bench
    finer = replace(bench, substeps=most)
    return climb(rung.model, finer, rung.result.weighting, briefly=True), finer


def _fitted(model: Model, weighting: Weighting, some: Bench) -> tuple[FitResult, int, bool]:
    """Return a rough fit in steps as fine as it asks for, how many, and if that is enough."""
    while True:
        steps, _ = _fine_enough(model, some)
        some = replace(some, substeps=steps)
        found = rough_fit(model, weighting, some, ROUGH_STEPS, finest=UTMOST)
        model = found.model
        again, right = _fine_enough(model, some)
        if again == steps:
            return found, steps, right


def _fine_enough(model: Model, bench: Bench) -> tuple[int, bool]:
    """Return so many integration steps that more are not worth it, and if what they do is small.

    Over the training data; what depends on the angle also over held-out ones: they may be faster.
    """
    steps, right = _enough(model, bench)
    if not bench.held or not (_ripples(model, bench) or model.kind.jumps):
        return steps, right
    steps, there = _enough(model, replace(bench, train=bench.held, substeps=steps))
    return steps, right and there


def _enough(model: Model, bench: Bench) -> tuple[int, bool]:
    """Return the same over the training data alone.

    Finer ones than `FINER` are worth it only where their error is not bearable; waves that pass
    within a sample are not followed at all before steps are finer than the waves.
    """
    steps, right = _steps(model, bench, FINER, _small)
    if right:
        return steps, right
    steps, bearable = _steps(model, replace(bench, substeps=steps), FINEST, _bearable)
    if not bearable and _ripples(model, bench) > QUICK * FINEST:
        steps, _ = _steps(model, replace(bench, substeps=steps), UTMOST, _bearable)
    return steps, False


def _ripples(model: Model, bench: Bench) -> float:
    """Return the radians of the finest wave over a turn that pass within a sample."""
    cards = [(key, effect(key).card.orders) for key in model.effects]
    waves = [model[f'{key}.{orders}'] for key, orders in cards if orders]
    return bench.scales.speed * bench.scales.sample * max(waves, default=0.0)


def _wrong(rung: Rung, bench: Bench) -> float:
    """Return the share of the whitened squares that is the integration's; 0 for rounding."""
    now, fine = _residuals(rung.model, bench), _residuals(rung.model, bench, JUDGE * FINEST)
    changes = _differences(fine, now)
    if _small(changes, now):
        return 0.0
    changed, left = (
        sum(float(np.sum(rung.result.weighting.flat(r[:, :, np.newaxis]) ** 2)) for r in each)
        for each in (changes, now)
    )
    return changed / left


def _share(changes: Sequence[Array], left: Sequence[Array]) -> float:
    changed, size = (np.mean(np.concatenate(r) ** 2, axis=0) for r in (changes, left))
    return float(np.sqrt(np.max(changed / np.maximum(size, 1e-300))))


def _small(changes: Sequence[Array], left: Sequence[Array]) -> bool:
    return _share(changes, left) <= ROUNDING


def _like(changes: Sequence[Array], left: Sequence[Array]) -> bool:
    return _share(changes, left) <= BLUNT


def _bearable(changes: Sequence[Array], left: Sequence[Array]) -> bool:
    return _share(changes, left) <= WRONG


def exact(rung: Rung, bench: Bench) -> tuple[Rung, Bench]:
    """Fit the last model with signs so sharp and steps so fine that they hardly move a parameter.

    How far they would is told by the derivatives: a change of the outputs moves the parameters as
    far as it lies along them.  What sharper signs and finer steps could still move is part of the
    standard error, and so are noise that is correlated for long and pits apart from one another.
    Some of the data tell.
    """
    rung, apart = deepest(rung, bench)
    some, weighting = replace(bench, train=some_of(bench, rung.model)), rung.result.weighting
    start = bench
    near = slopes(rung if some.train is bench.train else replace(rung, near=()), some)
    problem = bench.problem(rung.model)
    slope = np.abs(problem.slope(problem.vector()))
    sigma = np.array([p.sigma if p.sigma else np.inf for p in problem.free])

    def moves(changes: Sequence[Array]) -> Array:
        moved = [replace(one, residual=c) for one, c in zip(near, changes, strict=True)]
        return np.abs(newton_step(*normal_equations(moved, weighting)[:2])) * slope

    def small(changes: Sequence[Array], left: Sequence[Array]) -> bool:
        return bool(np.all(moves(changes) <= MOVE * sigma))

    last, blunt = rung, np.zeros(sigma.size)
    model, changes = _sharpened(rung.model, some, small)
    if changes:
        blunt = moves(changes) / (1 if model is rung.model else SHARPER - 1)
    steps, right = _steps(model, some, FINEST, small)
    if steps != bench.substeps or model is not rung.model:
        bench = replace(bench, substeps=steps)
        if model is rung.model:
            begun = replace(rung, near=tuple(slopes(rung, start)))
        else:  # where signs are sharper, derivatives are others
            begun = _begun_sharp(rung, model, bench)
        last, unsettled = _followed(begun, bench, sigma)
        blunt = np.hypot(blunt, unsettled)
    last = strode(last, bench)
    if not right:
        runs = [_residuals(last.model, some, n) for n in (JUDGE * FINEST, steps)]
        blunt = np.hypot(blunt, moves(_differences(*runs)))
    blunt = np.hypot(blunt, apart)
    return unbiased(replace(last, result=honest(last, bench, blunt)), bench), bench


def _begun_sharp(rung: Rung, model: Model, bench: Bench) -> Rung:
    """Return the fit of a model with sharper signs to some of the data, with derivatives on all.

    In steps that fine a fit to all of them would take most of the time of a diagnosis.
    """
    weighting = rung.result.weighting
    found = rough_fit(model, weighting, bench, ROUGH_STEPS, reweight=0, finest=FINEST).model
    problem = bench.problem(found)
    near = tuple(problem.linearize(problem.vector()))
    return replace(rung, result=replace(rung.result, model=found), near=near)


def _followed(rung: Rung, bench: Bench, sigma: Array) -> tuple[Rung, Array]:
    """Return the fit near a model in the steps of `bench`, and how far it may not be settled.

    It begins with the derivatives that are known, and learns from each step how the sum of squares
    is bent in these steps; where this leads nowhere, derivatives are taken again.  Where that
    leads nowhere either, the cost is rough, and the least that was seen counts.  On a bound the
    model is fitted anew.  The last step is not fitted again: it is taken unless it spoils what is
    held out, as where a parameter that is not seen goes far astray.
    """
    problem, weighting = bench.problem(rung.model), rung.result.weighting
    lower, upper = problem.box()
    z, slope = problem.vector(), np.abs(problem.slope(problem.vector()))
    known: Sequence[Linearization] = problem.adopt(rung.near)
    best, unsettled = Solution(z, np.inf, False, 0, 0), np.zeros(sigma.size)
    last: tuple[Array, Array, Array] | None = None
    for runs in range(1, 2 * CHORDS + 1):
        if runs == CHORDS + 1:
            z, known, last = best.z, problem.linearize(best.z), None
        finer = problem.linearize(z, parameters=False)
        near = [replace(a, residual=b.residual) for a, b in zip(known, finer, strict=True)]
        gradient, curvature, cost = normal_equations(near, weighting)
        if last is not None and not cost < best.cost:
            z = best.z + SHORTER * (z - best.z)
            continue
        if last is not None:
            there, downhill, bent = last
            curvature = _secant(bent, z - there, downhill - gradient)
        last = z, gradient, curvature
        move = newton_step(gradient, curvature)
        if not np.all(np.isfinite(move)) or np.any((z <= lower) | (z >= upper)):
            return climb(rung.model, bench, weighting, briefly=True), np.zeros(sigma.size)
        promise, moved = float(move @ gradient), np.abs(move) * slope
        best, unsettled = Solution(z, cost, False, runs, runs, tuple(near)), moved
        z = np.clip(z + move, lower, upper)
        if promise < BRIEF * cost or np.all(moved <= MOVE * sigma):
            near = [replace(one, residual=one.residual - one.slope @ move) for one in near]
            last_one = Solution(z, cost - promise, True, runs, runs, tuple(near))
            found = _judged(problem, weighting, last_one, bench)
            if found.held.error_percent < SPOILED * rung.held.error_percent:
                return found, 0 * move
            break
    best = replace(best, rough=best.iterations < 2 * CHORDS)
    return _judged(problem, weighting, best, bench), unsettled


def _judged(problem: Problem, weighting: Weighting, at: Solution, bench: Bench) -> Rung:
    """Return the fit that is a solution."""
    return judge(result_at(problem, weighting, at, at.simulations, at.iterations), bench, at.near)


def _secant(curvature: Array, step: Array, fall: Array) -> Array:
    """Return a curvature that knows how the downhill gradient fell along a step.

    The update of Broyden, Fletcher, Goldfarb and Shanno (Nocedal and Wright, Numerical
    Optimization, 2006, section 6.1), where it keeps all curvatures positive.
    """
    along, bent = float(fall @ step), curvature @ step
    expected = float(bent @ step)
    if not along > LEAST_BEND * expected > 0.0:
        return curvature
    found: Array = (
        curvature - np.outer(bent, bent) / expected + np.outer(fall, fall) / along
    )
    return found


def _sharper(model: Model) -> Model:
    """Return the model with every smoothed sign `SHARPER` times narrower; itself without one."""
    needed = {name for key in model.effects for name in model.effect(key).needs()}
    widths = {n: model[n] / SHARPER for n in WIDTHS if n in needed and n in model.parameters}
    return model.with_values(widths) if widths else model


def _sharpened(
    model: Model, bench: Bench, small: Callable[[Sequence[Array], Sequence[Array]], bool]
) -> tuple[Model, list[Array]]:
    """Return the model, with sharper signs where these bring it nearer to what exact ones do.

    That is told by sharper signs in finer steps than any fit takes: where these steps are not
    fine enough for sharper signs, blunt ones may be nearer.  Also returned is how far blunt signs
    are from there, if that is not `small`.
    """
    sharp = _sharper(model)
    if sharp is model:
        return model, []
    right = _residuals(sharp, bench, JUDGE * FINEST)
    blunt = _differences(right, _residuals(model, bench, FINEST))
    if small(blunt, right):
        return model, []
    nearer = _share(_differences(right, _residuals(sharp, bench, FINEST)), blunt) < 1.0
    return (sharp if nearer else model), blunt


def _residuals(model: Model, bench: Bench, steps: int = 0) -> Sequence[Array]:
    """Return the residuals over the training data; in the finest steps a model is run once."""
    steps, values = steps or bench.substeps, tuple(model.parameters.values().items())
    place = id(bench.train), steps, model.speed_sensor, values
    if place not in bench.runs:
        found = compare(model, bench.train, bench.outputs, substeps=steps).residuals
        if steps < FINEST:
            return found
        for oldest in list(bench.runs)[: 1 - KEPT_RUNS]:
            del bench.runs[oldest]
        bench.runs[place] = bench.train, found
    return bench.runs[place][1]


def _differences(one: Sequence[Array], other: Sequence[Array]) -> list[Array]:
    return [a - b for a, b in zip(one, other, strict=True)]


def _steps(
    model: Model,
    bench: Bench,
    most: int,
    small: Callable[[Sequence[Array], Sequence[Array]], bool],
) -> tuple[int, bool]:
    """Return so many integration steps that more make a small change of the outputs, and if so.

    Where even `most` come little nearer to what many more make of it, as where a law strikes or
    chatters, finer steps bring nothing, and none are taken.
    """
    steps = bench.substeps
    linear = model.kind.own is None and all(effect(key).card.linear for key in model.effects)
    if steps >= most or linear:
        return steps, linear
    now = _residuals(model, bench)
    fine = _residuals(model, bench, FINER_BY * steps)
    if small(_differences(fine, now), now):
        return steps, True
    if most > 2 * steps:
        fine = _residuals(model, bench, JUDGE * most)
    while 2 * steps < most:
        steps *= 2
        if small(_differences(fine, _residuals(model, bench, steps)), now):
            return steps, True
    off = [_share(_differences(fine, r), now) for r in (now, _residuals(model, bench, most))]
    return (most if off[1] < NEARER * off[0] else bench.substeps), False


