"""Add an effect, refit, and ask whether the gain is real."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.compare import compare, Comparison, comparison_of
from motor_sysid.diagnosis.moments import with_best_moments
from motor_sysid.diagnosis.score import Scored
from motor_sysid.diagnosis.setup import Bench
from motor_sysid.diagnosis.threshold import UNCALIBRATED
from motor_sysid.estimation.batch import (
    fit,
    fit_and_slopes,
    FitResult,
    Linearization,
    misfit,
    Problem,
    Weighting,
    white,
)
from motor_sysid.estimation.batch.least_squares import normal_equations, result_at, Solution
from motor_sysid.physics.effect import Effect, Scale
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

MIN_DELTA_BIC = UNCALIBRATED
"""Gain in BIC that evidence must have where `Bench.threshold` says nothing else."""

MIN_GAIN_PERCENT = 1.0
MIN_FURTHER_GAIN_PERCENT = 5.0
"""Relative decrease of the held-out error that an effect must bring to matter: the first one, and
every further one, for what the first does not fit to the last detail looks like a second one."""

UNPHYSICAL = 'unphysical sign'

BRIEF_STEPS = 5
"""Most steps of a fit of a trial, which begins near its end."""

BRIEF, FULL = 1e-5, 1e-7
"""Promised relative decrease of the sum of squares at which a fit of a trial ends, and any other.
"""

ROUGH, ROUGH_STEPS, FIRST_STEPS = 1e-3, 12, 4
"""The same for a fit to some of the data, its most steps, and after how many of them the best of
several starts is chosen."""

_FAST = (Scale.RATE, Scale.SAMPLE, Scale.ANGLE)
"""Scales of parameters that tell of a memory that fades within some samples."""

FINE = 4
"""Integration steps per sample where one is not enough."""

MANY = 4
"""Variants above which an effect is refitted from several of them."""

BLOCKS = 20
MIN_STEADY = 0.75
"""Steadiness of a gain over held-out blocks: the sum of what the blocks gain, over that of what
they gain and lose.  It is 1 where no block loses and near 0.5 by chance."""

CERTAIN_GAIN, CERTAIN_STEADY, CERTAIN_T = 10.0, 0.9, 3.0
"""An effect whose gain is lost in the noise of the sensors is believed if the whitened held-out
error falls by this much and either steadily, or by so many standard errors of its block means."""

MIN_SHARE, MIN_FURTHER_SHARE = 0.1, 0.5
"""Share of all that the whole dictionary could still explain, which such a small effect must
explain alone: the first one, and further ones, which may be the misfit of the first."""

ALIKE = 0.9999
"""Share of an effect that base parameters mimic, above which they are called alike."""


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


@dataclass(frozen=True)
class Trial:
    """A candidate after its refit.

    Attributes
    ----------
    scored:
        The score that it was chosen by.
    rung:
        The fitted model.
    delta_bic:
        Gain in BIC under the noise model that the whole dictionary leaves.
    gain_percent:
        Relative decrease of the held-out error.
    steady:
        Steadiness of that decrease over held-out blocks, 0 to 1; see `MIN_STEADY`.
    note:
        Why it does not pass, or empty.
    excess:
        Whitened variance that the refit leaves, in units of the noise; 1 where only noise is left.
    """

    scored: Scored
    rung: Rung
    delta_bic: float
    gain_percent: float
    steady: float
    note: str
    excess: float

    @property
    def key(self) -> str:
        """Key of the effect."""
        return self.scored.variant.effect.key

    @property
    def passes(self) -> bool:
        """Whether every gate was passed."""
        return not self.note


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
        problem, start, reweight=reweight, iterations=iterations, tolerance=tolerance, near=near
    )
    moved = with_best_moments(bench.problem(result.model), result.weighting)
    if moved is not result.model:
        result, near = fit_and_slopes(
            bench.problem(moved), result.weighting, reweight=reweight, iterations=iterations,
            tolerance=tolerance,
        )  # fmt: skip
    return judge(result, bench, near)


def polish(rung: Rung, bench: Bench) -> Rung:
    """Fit a model that was fitted over short looks ahead once more over free runs.

    The result counts only if it runs better on held-out data, too.
    """
    if bench.horizon is None:
        return rung
    free = Problem(rung.model, bench.train_free, bench.outputs, substeps=bench.substeps)
    better = judge(fit(free), bench)
    improved = better.validation.error_percent < rung.validation.error_percent
    improved = improved and not any(vanished(better.model, key) for key in better.model.effects)
    return better if improved else rung


def judge(result: FitResult, bench: Bench, near: Sequence[Linearization] = ()) -> Rung:
    """Take the errors of a fitted model; `near` holds its residuals on the training data."""
    outputs, substeps = bench.outputs, bench.substeps
    if near and bench.train_free is bench.train:
        training = comparison_of([one.residual for one in near], bench.problem(result.model))
    else:
        training = compare(result.model, bench.train_free, outputs, substeps=substeps)
    held = compare(result.model, bench.held, outputs, substeps=substeps)
    free = held
    if bench.held_free is not bench.held:
        free = compare(result.model, bench.held_free, outputs, substeps=substeps)
    return Rung(result, training, free, held, tuple(near), substeps)


def refined(rung: Rung, bench: Bench) -> tuple[Rung, Bench]:
    """Check the integration of a fitted model, and refit with finer steps where it matters.

    Integration error would count as missing physics; it may be a tenth of the remaining error.
    """
    if bench.substeps >= FINE or not rung.model.effects:
        return rung, bench
    fine = replace(bench, substeps=FINE)
    coarse = np.concatenate(rung.training.residuals)
    finer = np.concatenate(
        compare(rung.model, bench.train_free, bench.outputs, substeps=FINE).residuals
    )
    change = np.sqrt(np.mean((finer - coarse) ** 2, axis=0))
    if np.all(change < 0.1 * np.sqrt(np.mean(coarse**2, axis=0))):
        return rung, bench
    return climb(rung.model, fine, rung.result.weighting), fine


def slopes(rung: Rung, bench: Bench) -> Sequence[Linearization]:
    """Return residuals and derivatives of a fitted model over the training data."""
    if rung.near and rung.substeps == bench.substeps:
        return rung.near
    problem = bench.problem(rung.model)
    return problem.linearize(problem.vector())


def profile_cost(rung: Rung, bench: Bench, weighting: Weighting) -> tuple[float, int]:
    """Return the whitened sum of squares at the nearest minimum, and the number of rows."""
    near = slopes(rung, bench)
    gradient, curvature, cost = normal_equations(near, weighting)
    scale = np.sqrt(np.maximum(np.diag(curvature), 1e-300))
    step = np.linalg.lstsq(curvature / np.outer(scale, scale), gradient / scale, rcond=1e-10)[0]
    rows = sum(one.residual.size for one in near)
    return cost - float(step @ (gradient / scale)), rows


def try_effect(
    starts: Sequence[Scored], rung: Rung, bench: Bench, weighting: Weighting
) -> Trial:
    """Refit an effect from its best variants and keep the best refit."""
    return settled(try_roughly(starts, rung, bench, weighting), rung, bench, weighting)


def try_roughly(
    starts: Sequence[Scored], rung: Rung, bench: Bench, weighting: Weighting
) -> Trial:
    """Fit an effect from its best variants to some of the data, and judge the best on all."""
    possible = [one for one in starts if not _impossible(one)]
    if not possible:
        one = starts[0]
        return Trial(one, rung, one.delta_bic, 0.0, 0.0, UNPHYSICAL, np.inf)
    models = [_opened(one.variant.model, rung.model, one) for one in possible]
    weightings, best = [rung.result.weighting] * len(models), 0
    if len(models) > 1:
        fits = [_rough_fit(model, rung.result.weighting, bench, FIRST_STEPS) for model in models]
        models, weightings = [f.model for f in fits], [f.weighting for f in fits]
        best = min(range(len(fits)), key=lambda k: misfit(fits[k]))
    rough = _rough_fit(models[best], weightings[best], bench, ROUGH_STEPS)
    return _judged(possible[best], _standing(rough, bench), rung, bench, weighting)


def settled(trial: Trial, rung: Rung, bench: Bench, weighting: Weighting) -> Trial:
    """Fit a trial that was judged after a rough fit to all of the data."""
    if trial.rung is rung:
        return trial
    rough = trial.rung
    new = climb(rough.model, bench, rough.result.weighting, briefly=True, near=rough.near)
    return _judged(trial.scored, replace(new, near=()), rung, bench, weighting, new.near)


def _rough_fit(model: Model, weighting: Weighting, bench: Bench, steps: int) -> FitResult:
    """Fit a model to some of the data; to all, where an effect remembers for long."""
    lasting = any(_lasts(effect(key)) for key in model.effects)
    chains = bench.train if lasting else bench.rough
    problem = Problem(model, chains, bench.outputs, substeps=bench.substeps)
    return fit(problem, weighting, reweight=1, iterations=steps, tolerance=ROUGH)


def _standing(rough: FitResult, bench: Bench) -> Rung:
    """Judge a rough fit on all of the data, its noise taken from all of them."""
    problem = bench.problem(rough.model)
    near = tuple(problem.linearize(problem.vector()))
    weighting = white([problem.settled(one, rough.weighting) for one in near])
    cost = normal_equations(near, weighting)[2]
    at = Solution(problem.vector(), cost, False, 0, 0, near)
    return judge(result_at(problem, weighting, at, rough.simulations, 0), bench, near)


def _lasts(one: Effect) -> bool:
    """Whether an effect cannot be seen in pieces of a record: what it does depends on long ago."""
    fast = any(p.scale in _FAST for p in one.card.parameters)
    return bool(one.card.moment) or bool(one.card.states and not fast)


def try_pair(
    pair: tuple[Scored, Scored], rung: Rung, bench: Bench, weighting: Weighting
) -> tuple[Rung, float]:
    """Refit two effects together; return the fit and its gain in BIC."""
    first, second = pair
    other = second.variant
    tried = first.variant.model.with_effect(other.effect.key, other.values, bench.scales)
    fixed = tried.with_free([f'{other.effect.key}.{name}' for name in other.values], free=False)
    model = _opened(_opened(fixed, rung.model, first), rung.model, second)
    new = _standing(_rough_fit(model, rung.result.weighting, bench, ROUGH_STEPS), bench)
    if not np.isfinite(new.result.cost + new.held.error_percent):
        return new, -np.inf
    new = climb(new.model, bench, new.result.weighting, briefly=True, near=new.near)
    return new, gain_in_bic(rung, new, bench, weighting)


def gain_in_bic(before: Rung, after: Rung, bench: Bench, weighting: Weighting) -> float:
    """Return the gain in BIC from one fitted model to another one with more parameters."""
    old, rows = profile_cost(before, bench, weighting)
    new, _ = profile_cost(after, bench, weighting)
    extra = len(after.model.parameters.free) - len(before.model.parameters.free)
    return old - new - extra * float(np.log(rows))


def _judged(
    scored: Scored,
    new: Rung,
    rung: Rung,
    bench: Bench,
    weighting: Weighting,
    near: Sequence[Linearization] = (),
) -> Trial:
    """Pass a refit through the gates; `near` if the refit does not hold its own."""
    if not np.isfinite(new.result.cost + new.held.error_percent):
        return Trial(scored, rung, -np.inf, 0.0, 0.0, 'cannot be simulated', np.inf)
    before, rows = profile_cost(rung, bench, weighting)
    after, _ = profile_cost(replace(new, near=tuple(near)) if near else new, bench, weighting)
    extra = len(new.model.parameters.free) - len(rung.model.parameters.free)
    delta = before - after - extra * float(np.log(rows))
    gain = 100 * (1 - _combined(new.held, rung.held))
    steady = _steady(rung.held, new.held)
    share = (before - after) / max(before - rows, 1e-300)
    small = share > (MIN_FURTHER_SHARE if rung.model.effects else MIN_SHARE)
    certain = small and _certain(rung.held, new.held, weighting)
    note = _gate(scored, new, rung, delta, gain, steady, certain, bench.threshold)
    return Trial(scored, new, delta, gain, steady, note, after / rows)


def _impossible(scored: Scored) -> bool:
    """Whether every amplitude would have to have a sign that physics forbids."""
    one = scored.variant.effect
    return all(
        a.positive and not a.trials and scored.amplitudes.get(a.name, 1.0) == 0.0
        for a in one.card.amplitudes
    )


def _opened(tried: Model, base: Model, scored: Scored) -> Model:
    """Return the variant with its start values and all that may be fitted free again."""
    key = scored.variant.effect.key
    free = [p.name for p in base.parameters.free if p.name in tried.parameters]
    card = scored.variant.effect.card
    free += [f'{key}.{a.name}' for a in card.amplitudes]
    free += [f'{key}.{s.name}' for s in card.shapes if s.free]
    start = {name: value for name, value in scored.base.items() if name in tried.parameters}
    start |= {f'{key}.{name}': value for name, value in scored.amplitudes.items()}
    share = 1.0 + start.get(f'{key}.{card.amplitudes[0].name}', 0.0)
    for name in card.shrinks:
        p = base.parameters[name]
        start[name] = float(np.clip(p.value / share, p.lower, p.upper))
    return tried.with_free(free).with_values(start)


def _combined(now: Comparison, before: Comparison) -> float:
    """Return the error with each channel in units of its error under the model before."""
    old, new = before.channel_percent, now.channel_percent
    parts = [(new[name] / max(old[name], 1e-12)) ** 2 for name in new]
    return float(np.sqrt(np.mean(parts)))


def _steady(before: Comparison, after: Comparison) -> float:
    """Return the steadiness of the gain, with each channel in units of its error before."""
    size = np.sqrt(np.mean(np.concatenate(before.residuals) ** 2, axis=0)) + 1e-300
    pairs = zip(before.residuals, after.residuals, strict=True)
    gains = [np.sum((a / size) ** 2 - (b / size) ** 2, axis=1) for a, b in pairs]
    return _steadiness(_blocks(gains))


def _certain(before: Comparison, after: Comparison, weighting: Weighting) -> bool:
    """Whether the whitened held-out error falls beyond doubt, however small the gain looks."""
    pairs = zip(before.residuals, after.residuals, strict=True)
    squares = [[weighting.flat(r[:, :, np.newaxis])[:, 0] ** 2 for r in pair] for pair in pairs]
    gains = _blocks([a - b for a, b in squares])
    error = float(gains.std(ddof=1)) / np.sqrt(gains.size) if gains.size > 1 else np.inf
    sure = _steadiness(gains) >= CERTAIN_STEADY or gains.mean() > CERTAIN_T * error
    return bool(gains.sum() > CERTAIN_GAIN and sure)


def _blocks(gains: Sequence[Array]) -> Array:
    """Return sums over about `BLOCKS` blocks of equal length."""
    total = sum(g.size for g in gains)
    pieces = [np.array_split(g, max(round(BLOCKS * g.size / total), 1)) for g in gains]
    return np.array([float(np.sum(piece)) for group in pieces for piece in group])


def _steadiness(gains: Array) -> float:
    return float(np.maximum(gains, 0.0).sum() / max(float(np.abs(gains).sum()), 1e-300))


def vanished(model: Model, key: str) -> bool:
    """Whether a fit has taken an effect of one sign to nothing."""
    own = [model.parameters[f'{key}.{a.name}'] for a in effect(key).card.amplitudes if a.positive]
    return bool(own) and all(p.value <= 1e-9 * p.upper for p in own)


def _gate(
    scored: Scored,
    new: Rung,
    old: Rung,
    delta: float,
    gain: float,
    steady: float,
    certain: bool,
    threshold: float,
) -> str:
    key = scored.variant.effect.key
    if vanished(new.model, key):
        return UNPHYSICAL
    if not np.isfinite(delta):
        return 'cannot be simulated'
    if delta < threshold:
        alike = scored.overlap > ALIKE
        return 'these data cannot tell it from what the model has' if alike else 'no evidence'
    if certain and gain > -MIN_GAIN_PERCENT:
        return ''
    if gain < (MIN_FURTHER_GAIN_PERCENT if old.model.effects else MIN_GAIN_PERCENT):
        return f'lowers the held-out error by {max(gain, 0.0):.1f} % only'
    if steady < MIN_STEADY:
        return 'helps in some of the held-out data and harms in other'
    return ''


def parameters_of(model: Model, key: str) -> Mapping[str, tuple[float, str, float]]:
    """Return the parameters of one effect: symbol to (value, unit, sigma)."""
    own = [p for p in model.parameters if p.name.startswith(f'{key}.')]
    return {
        p.name.split('.', 1)[1]: (p.value, p.unit, p.sigma if p.sigma is not None else 0.0)
        for p in own
    }


def best_per_effect(scores: Sequence[Scored], limit: int) -> list[list[Scored]]:
    """Return the best variants of each effect, at most `limit` effects, best first.

    Effects with many variants have many local minima: three starts are kept of them.  With an
    effect come its special cases, whatever their score: nothing may be named that is more than the
    data ask for.
    """
    best: dict[str, list[Scored]] = {}
    for one in scores:
        best.setdefault(one.variant.effect.key, []).append(one)
    chosen = list(best)[:limit]
    special = [s for key in chosen for s in effect(key).card.generalises]
    chosen += [key for key in dict.fromkeys(special) if key in best and key not in chosen]
    return [best[key][: 3 if len(best[key]) > MANY else 1] for key in chosen]
