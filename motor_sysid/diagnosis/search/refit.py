"""Add an effect, refit, and ask whether the gain is real."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.candidates.score import Scored
from motor_sysid.diagnosis.candidates.variants import shrunk
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.gates import MIN_GAIN_PERCENT, NO_EVIDENCE, UNPHYSICAL
from motor_sysid.diagnosis.search.grid_starts import begun_at, starts_on_grid
from motor_sysid.diagnosis.search.rung import (
    ASTRAY,
    climb,
    FINER,
    judge,
    leaves_much,
    lost,
    Rung,
    some_of,
)
from motor_sysid.diagnosis.search.sense import feeds
from motor_sysid.diagnosis.search.trial import judged, Level, Trial
from motor_sysid.estimation.batch import (
    fit,
    FitResult,
    misfit,
    Problem,
    Weighting,
    white,
)
from motor_sysid.estimation.batch.least_squares import normal_equations, result_at, Solution
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

ROUGH, ROUGH_STEPS, FIRST_STEPS = 1e-3, 12, 4
"""The same for a fit to some of the data, its most steps, and after how many of them the best of
several starts is chosen."""

BELOW = 0.01
"""Fall of the log of the error variances that is more than some of the data chose by chance."""

THOROUGH_STEPS, REWEIGHT = 30, 3
"""Most steps of such a fit for each noise model, and noise models, where all seems lost."""

WIDE = (100.0, 10.0)
"""How much wider a sign of current is, one after the other, where a fit begins as well.

Between coarse samples a narrow one chatters about zero, and a fit that begins far away does not
move; from a wide one it slides down.
"""

QUICK = 0.1
"""Electrical time constant in samples from which a fit of a delay or a lag begins as well: with
the inductance that made up for it, shorter delays seem as good."""

USUAL = 0.2
"""Amplitude in units of its scale from which a fit in full begins as well."""

WORTH = 0.5
"""Share of the best one's promise that further variants must make, unless so much is missing that
promises tell little."""


def try_effect(starts: Sequence[Scored], level: Level, bench: Bench) -> Trial:
    """Refit an effect from its best variants and keep the best refit."""
    return settled(try_roughly(starts, level, bench), level, bench)


def try_roughly(
    starts: Sequence[Scored],
    level: Level,
    bench: Bench,
    earlier: FitResult | None = None,
    *,
    give_up: bool = False,
) -> Trial:
    """Fit an effect from its best variants to some of the data, and judge the best on all.

    It begins as well from an `earlier` fit of the effect, if there is one, which stays where
    nothing does better if it was beside the same effects; and from the best of a grid where
    something is missing: a touch may have evidence where a noise model takes most of what is
    missing for noise.  Where another speed sensor fits better, the evidence decides: a load that
    comes and goes hides much of it.  With `give_up`, what begins above the model itself is not
    followed, unless that leaves much.
    """
    rung, much = level.rung, leaves_much(level.rung, bench)
    least = -np.inf if much else WORTH * max(one.gain for one in starts)
    possible = [one for one in starts if one.gain >= least and not _impossible(one)]
    tried = [(one, _opened(one.variant.model, rung.model, one)) for one in possible]
    one, model = starts[0], _opened(starts[0].variant.model, rung.model, starts[0])
    if level.is_incomplete or one.delta_bic > bench.threshold:
        points = starts_on_grid(one.variant, rung.model, bench)
        tried += [(one, begun_at(point, model, one.variant)) for point in points]
    if not tried:
        return Trial(one, rung, one.delta_bic, 0.0, 0.0, UNPHYSICAL, np.inf)
    one, model = tried[0]
    kept: list[Trial] = []
    if earlier is not None:
        tried.append((one, _as_in(earlier.model, model)))
        if set(earlier.model.effects) == set(model.effects):
            kept = [judged(one, _standing(earlier, bench), level, bench)]
    anew = lost(rung.model, bench)
    if not one.variant.model.parameters.free:
        anew = {n: v for n, v in bench.begun.items() if rung.model.parameters[n].free}
        quick = _quick(rung.model, bench) if level.is_incomplete else {}
        tried += [(start, m.with_values(quick)) for start, m in tried] if quick else []
    if anew:
        tried.append((one, model.with_values(anew)))

    race = replace(bench, rough=bench.few)

    def begun(one: Scored, model: Model) -> tuple[Scored, Model, FitResult]:
        first = rough_fit(model, rung.result.weighting, race, FIRST_STEPS, reweight=0)
        return one, model, first

    here = min((begun(one, model) for one, model in tried), key=lambda fit: misfit(fit[2]))
    one, model, _ = here
    others = bench.other_sensors(model)
    beside = [begun(one, model.with_speed_sensor(sensor)) for sensor in others]
    best = min((here, *beside), key=lambda fit: misfit(fit[2]))
    if give_up and not much and not kept and _is_above(best[2], rung, race):
        return Trial(one, rung, min(one.delta_bic, 0.0), 0.0, 0.0, NO_EVIDENCE, np.inf)
    both = 'speed_sensor' in one.variant.effect.laws or best is not here
    found = [_followed(*fit, level, bench) for fit in ((here, *beside) if both else (here,))]
    return _bent(better_of(*found, *kept), level, bench)


def _bent(trial: Trial, level: Level, bench: Bench) -> Trial:
    """Return a trial with a shape free that was held, if that leaves clearly less.

    Where the law as it is does not lower the training error to speak of, none is.
    """
    best, least = trial, (1 - MIN_GAIN_PERCENT / 100) * level.rung.training.error_percent
    helps = trial.rung.training.error_percent < least
    for shape in trial.scored.variant.effect.card.shapes if helps else ():
        name, size = f'{trial.key}.{shape.name}', bench.scales.size(shape.scale)
        held = not trial.rung.model.parameters[name].free
        for start in shape.bends if held else ():
            model = trial.rung.model.with_values({name: start * size}).with_free([name])
            found = rough_fit(model, trial.rung.result.weighting, bench, ROUGH_STEPS)
            found = _undrained(found, trial.key, bench)
            other = judged(trial.scored, _standing(found, bench), level, bench)
            clearly = 1 - MIN_GAIN_PERCENT / 100
            falls = 100 - other.gain_percent < clearly * (100 - best.gain_percent)
            sound = other.passes or not best.passes
            if falls and sound and other.delta_bic > best.delta_bic + bench.threshold:
                best = other
    return best


def better_of(*trials: Trial) -> Trial:
    """Return the best of several fits of one effect."""
    least = min(trial.rung.training.error_percent for trial in trials)
    return max(
        trials,
        key=lambda t: (t.passes, ASTRAY * t.rung.training.error_percent < least, t.delta_bic),
    )


def _as_in(found: Model, model: Model) -> Model:
    """Return a model with the values of what it shares with another one, inside its own boxes.

    What is free there is free.
    """
    shared = model.parameters.inside(found.parameters.values())
    free = [p.name for p in found.parameters.free if p.name in shared]
    return model.with_values(shared).with_free(free)


def _is_above(first: FitResult, rung: Rung, bench: Bench) -> bool:
    """Whether a fit with an effect is no lower than the model without, on the same data."""
    same = replace(bench, rough=some_of(bench, first.model))
    still = rough_fit(rung.model, rung.result.weighting, same, 0, reweight=0)
    return misfit(first) >= misfit(still)


def _quick(model: Model, bench: Bench) -> dict[str, float]:
    """Return inductances that make up for a delay or a lag at what a sample hardly shows."""
    size = QUICK * model['R'] * bench.train[0][0].drive.dt if 'R' in model.parameters else np.inf
    slow = (p for p in model.parameters.free if p.unit == 'H' and p.value > size)
    return {p.name: max(size, p.lower) for p in slow}


def _followed(
    one: Scored, model: Model, first: FitResult, level: Level, bench: Bench
) -> Trial:
    """Follow the first steps of a fit of `model` to the end of a rough one, and judge that."""
    rough = rough_fit(first.model, first.weighting, bench, ROUGH_STEPS)
    if chatters(model) and leaves_much(level.rung, bench):
        rough = min(rough, slid(model, first.weighting, bench), key=misfit)
    rough = _undrained(rough, one.variant.effect.key, bench)
    return judged(one, _standing(rough, bench), level, bench)


def _undrained(found: FitResult, key: str, bench: Bench) -> FitResult:
    """Return a rough fit in which an effect takes nothing from a friction that is not there."""
    held = _dried(found.model, key, bench)
    if held is found.model:
        return found
    return rough_fit(held, found.weighting, bench, ROUGH_STEPS)


def _dried(model: Model, key: str, bench: Bench) -> Model:
    """Return a model in which an effect uses up no friction that is not there.

    Of an effect that changes several frictions the others may change all the same.
    """
    if not feeds(model, key, bench.scales.duration):
        return model
    dry = [
        f'{key}.{name}' for name, sources in effect(key).card.drains.items()
        if not any(source in model.parameters for source in sources)
    ]  # fmt: skip
    if not dry:
        return model
    return model.with_values(dict.fromkeys(dry, 0.0)).with_free(dry, free=False)


def chatters(model: Model) -> bool:
    """Whether a law of the model has a sign of current."""
    return any('i_eps' in model.effect(key).needs() for key in model.effects)


def slid(model: Model, weighting: Weighting, bench: Bench) -> FitResult:
    """Return a rough fit from where wide signs of current lead."""
    width = model['i_eps']
    for wider in WIDE:
        wide = model.with_values({'i_eps': wider * width})
        model = rough_fit(wide, weighting, bench, ROUGH_STEPS).model
    return rough_fit(model.with_values({'i_eps': width}), weighting, bench, ROUGH_STEPS)


def try_beside(trial: Trial, other: Trial, level: Level, bench: Bench) -> Trial:
    """Fit an effect from where the fit of another one of its kind ended; return the better fit.

    The motor's own parameters may have gone far astray without either, and a sharp law has many
    valleys on the way back.
    """
    model, mine = trial.scored.variant.model, trial.scored.variant.effect.card.amplitudes[0]
    theirs = other.scored.variant.effect.card.amplitudes[0]
    model = _opened(model, level.rung.model, trial.scored)
    found, size = other.rung.model, model.parameters[f'{trial.key}.{mine.name}']
    values = {p.name: found[p.name] for p in level.rung.model.parameters.free}
    values[size.name] = float(np.clip(found[f'{other.key}.{theirs.name}'], size.lower, size.upper))
    model = model.with_values(values).with_speed_sensor(found.speed_sensor)
    rough = rough_fit(model, other.rung.result.weighting, bench, ROUGH_STEPS)
    again = judged(trial.scored, _standing(rough, bench), level, bench)
    return again if again.delta_bic > trial.delta_bic else trial


def of_a_kind(one: Trial, other: Trial) -> bool:
    """Whether the effects of two trials push the same equation by a law of the same thing."""
    first, second = one.scored.variant, other.scored.variant
    mine, theirs = first.effect.card, second.effect.card
    alike = mine.axis == theirs.axis and mine.amplitudes[0].unit == theirs.amplitudes[0].unit
    same = one.key != other.key and set(first.effect.laws) & set(second.effect.laws)
    return bool(alike and same) and not (first.inherits or second.inherits)


def try_thoroughly(start: Scored, level: Level, bench: Bench) -> Trial:
    """Fit an effect with a noise model of its own, in the end to all of the data, and judge it.

    Where much is missing, the noise model of a rough fit takes most of it for noise, and the score
    promises too little; and where signs are sharp already, the way has many valleys.
    """
    model = _opened(start.variant.model, level.rung.model, start)
    widths = {name: model[name] for name in bench.blunt if name in model.parameters}
    blunt = {name: max(widths[name], bench.blunt[name]) for name in widths}
    key, first = start.variant.effect.key, start.variant.effect.card.amplitudes[0]
    size = model.parameters[f'{key}.{first.name}']
    usual = min(USUAL * bench.scales.size(first.scale), size.upper)
    more = min(size.value, -usual) if size.value < 0.0 else max(size.value, usual)
    fits = [
        rough_fit(
            model.with_values({**blunt, size.name: value}), None, bench, THOROUGH_STEPS,
            reweight=REWEIGHT,
        )
        for value in dict.fromkeys((size.value, more))
    ]  # fmt: skip
    best = min(fits, key=misfit)
    new = climb(best.model.with_values(widths), bench, best.weighting)
    return judged(start, replace(new, near=()), level, bench, new.near)


def settled(trial: Trial, level: Level, bench: Bench) -> Trial:
    """Fit a trial that was judged after a rough fit to all of the data."""
    if trial.rung is level.rung:
        return trial
    rough = trial.rung
    new = climb(rough.model, bench, rough.result.weighting, briefly=True, near=rough.near)
    held = _dried(new.model, trial.key, bench)
    if held is not new.model:
        new = climb(held, bench, new.result.weighting, briefly=True)
    return judged(trial.scored, replace(new, near=()), level, bench, new.near)


def rough_fit(
    model: Model,
    weighting: Weighting | None,
    bench: Bench,
    steps: int,
    *,
    reweight: int = 1,
    finest: int = FINER,
) -> FitResult:
    """Fit a model to some of the data; to all, where an effect remembers for long.

    Without a `weighting` it begins with noise as large as the signals.
    What steps finer than `finest` to a sample tell is left to the judgement of the fit.
    """
    chains, substeps = some_of(bench, model), min(bench.substeps, finest)
    problem = Problem(model, chains, bench.outputs, substeps=substeps, one_sided=True)
    return fit(problem, weighting, reweight=reweight, iterations=steps, tolerance=ROUGH)


def leads_lower(begun: Model, rung: Rung, bench: Bench) -> bool:
    """Whether a fit from `begun` to some of the data ends below where a fitted model is."""
    there, here = (
        misfit(rough_fit(model, rung.result.weighting, bench, steps, reweight=0))
        for model, steps in ((begun, ROUGH_STEPS), (rung.model, 0))
    )
    return there < here - BELOW


def _standing(rough: FitResult, bench: Bench) -> Rung:
    """Judge a rough fit on all of the data, its noise taken from all of them."""
    problem = Problem(
        rough.model, bench.train, bench.outputs, substeps=bench.substeps, one_sided=True
    )
    near = tuple(problem.linearize(problem.vector()))
    weighting = white([problem.settled(one, rough.weighting) for one in near])
    cost = normal_equations(near, weighting)[2]
    at = Solution(problem.vector(), cost, False, 0, 0, near)
    return judge(result_at(problem, weighting, at, rough.simulations, 0), bench, near)


def try_pair(
    pair: tuple[Scored, Scored], level: Level, bench: Bench
) -> tuple[Rung, float]:
    """Fit two effects together to some of the data; return the fit and its gain in BIC on all."""
    first, second = pair
    other = second.variant
    tried = first.variant.model.with_effect(other.effect.key, other.values, bench.scales)
    fixed = tried.with_free([f'{other.effect.key}.{name}' for name in other.values], free=False)
    base = level.rung
    model = _opened(_opened(fixed, base.model, first), base.model, second)
    new = _standing(rough_fit(model, base.result.weighting, bench, ROUGH_STEPS), bench)
    if not np.isfinite(new.result.cost + new.held.error_percent):
        return new, -np.inf
    return new, level.gain(new, bench)


def settled_pair(new: Rung, level: Level, bench: Bench) -> tuple[Rung, float]:
    """Fit a pair to all of the data; return the fit and its gain in BIC."""
    new = climb(new.model, bench, new.result.weighting, briefly=True, near=new.near)
    return new, level.gain(new, bench)


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
    free += [
        f'{other}.{name}'
        for other in base.effects
        if other in tried.effects
        for name, sources in effect(other).card.drains.items()
        if any(source in tried.parameters for source in sources)
    ]
    if not scored.variant.inherits:
        start |= shrunk(card, base, start.get(f'{key}.{card.amplitudes[0].name}', 0.0))
    return tried.with_free(free).with_values(start)


def parameters_of(model: Model, key: str) -> Mapping[str, tuple[float, str, float]]:
    """Return the parameters of one effect: symbol to (value, unit, sigma)."""
    own = [p for p in model.parameters if p.name.startswith(f'{key}.')]
    return {
        p.name.split('.', 1)[1]: (p.value, p.unit, p.sigma if p.sigma is not None else 0.0)
        for p in own
    }
