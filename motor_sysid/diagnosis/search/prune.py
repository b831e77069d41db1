"""What later effects have made superfluous goes again: whole effects, and too wide laws.

While something else is missing, an effect may do duty for it, and a law with one parameter more
may look better than the one that is there.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from motor_sysid.diagnosis.result.names import titles
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.gain import gain_percent, is_certain
from motor_sysid.diagnosis.search.gates import (
    LEAST_CERTAINTY,
    MIN_CERTAIN_GAIN_PERCENT,
    MIN_GAIN_PERCENT,
    SURE_GAIN,
)
from motor_sysid.diagnosis.search.refit import parameters_of, rough_fit, ROUGH_STEPS
from motor_sysid.diagnosis.search.rung import certainty, climb, FINER, profile_cost, Rung, some_of
from motor_sysid.diagnosis.search.sense import is_vague
from motor_sysid.diagnosis.search.trial import Ladder, ONLY_NOISE
from motor_sysid.diagnosis.where.compare import compare
from motor_sysid.estimation.batch.least_squares import normal_equations
from motor_sysid.physics.effect import FAITHFUL
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.scales import Scales

BEYOND_DOUBT = 100.0
"""Squared number of standard errors, in units of the evidence asked for, from which on an effect
is kept without a fit that lacks it, unless steps of the integration have changed."""

CLEARLY = 10.0
"""Loss of evidence by a rough fit without it, in units of what is allowed, from which on an effect
is kept without a fit in full."""


def pruned(
    rung: Rung,
    bench: Bench,
    gains: dict[str, float],
    tell: Callable[[str], None],
    *,
    last: bool = False,
) -> Rung:
    """Drop effects that the last one has made superfluous, and narrow those that are too wide.

    What was added on a law that was too wide may be superfluous beside the right one.

    Parameters
    ----------
    rung, bench:
        The fit, and what it was fitted on.
    gains:
        Gain in BIC of each effect when it was added; a special case takes over the one that it
        stands for.
    tell:
        Is told what is dropped.
    last:
        Whether the last effect may go as well: what a coarse integration did wrong may have looked
        like it.
    """
    narrowed_one = False
    for key in rung.model.effects if last else rung.model.effects[:-1]:
        if key not in rung.model.effects or bench.shows(key):
            continue
        if last or certainty(rung, key) <= BEYOND_DOUBT * bench.threshold:
            slim = _simpler(rung, numbered(rung.model.without_effect(key), bench.scales), bench)
            if slim is not rung:
                tell(f'dropping {titles([key])}: no longer needed')
                rung = slim
                continue
        for special in effect(key).card.generalises:
            refused = bench.offered and special not in bench.offered
            there = special in rung.model.effects
            if refused or there or not rung.model.admits(effect(special)):
                continue
            model = special_case(rung.model, key, special, bench.scales)
            vague = is_vague(rung.model, key, special)
            inexact = np.inf if vague else FAITHFUL**2 * gains.get(key, 0.0)
            slim = _simpler(rung, model, bench, inexact)
            if slim is not rung:
                tell(f'{special} does in place of {key}')
                gains[special] = gains.get(key, 0.0)
                rung, narrowed_one = slim, True
                break
    return pruned(rung, bench, gains, tell, last=True) if narrowed_one and not last else rung


def led_out(rung: Rung, before: Rung, bench: Bench, tell: Callable[[str], None]) -> Rung:
    """Return a fit without the effect that it has beyond `before`, where that one lay in a pit.

    What a new effect moved the others to may be as good without it, and better than what they were
    before by all that evidence takes: then it is nothing itself.
    """
    own = before.model.effects
    further = [key for key in rung.model.effects if key not in own]
    if not own or len(further) != 1 or not set(own) < set(rung.model.effects):
        return rung
    if certainty(rung, further[0]) > BEYOND_DOUBT * bench.threshold:
        return rung
    slim = _simpler(rung, numbered(rung.model.without_effect(further[0]), bench.scales), bench)
    if slim is rung:
        return rung
    now, was = (profile_cost(fit, bench, rung.result.weighting)[0] for fit in (slim, before))
    if now > was - bench.threshold:
        return rung
    tell(f'dropping {titles(further)}: no longer needed')
    return slim


def relieved(
    ladder: Ladder, bench: Bench, start: Sequence[str], tell: Callable[[str], None]
) -> Rung:
    """Return the last fit of a ladder, without an effect that held-out data run better without.

    Beside others that were not in the model from the `start`.  The training data may have asked
    for it while something else was missing, and ask for it still to mend what a law has not right.
    What lowered the held-out error by much when it was added is not asked again.
    """
    rung = ladder[-1][0]
    own = [key for key in rung.model.effects if key not in start]
    for key in own if len(own) > 1 else []:
        if _has_helped(key, ladder):
            continue
        model = numbered(rung.model.without_effect(key), bench.scales)
        rough = rough_fit(model, rung.result.weighting, bench, ROUGH_STEPS, reweight=0)
        held = compare(rough.model, bench.held, bench.outputs, substeps=bench.substeps)
        if held.error_percent < rung.held.error_percent:
            slim = climb(rough.model, bench, rung.result.weighting)
            if runs_clearly_better(slim, rung):
                tell(f'dropping {titles([key])}: held-out data do better without it')
                return slim
    return rung


def runs_clearly_better(other: Rung, rung: Rung) -> bool:
    """Whether another fit leaves a held-out error that is lower by more than a hundredth."""
    return other.held.error_percent < (1 - MIN_GAIN_PERCENT / 100) * rung.held.error_percent


def _has_helped(key: str, ladder: Ladder) -> bool:
    """Whether the held-out error fell by much with the fit in which an effect was new."""
    for (before, _), (after, _) in pairwise(ladder):
        if key in set(after.model.effects) - set(before.model.effects):
            return gain_percent(before.held, after.held) > SURE_GAIN
    return False


def numbered(model: Model, scales: Scales) -> Model:
    """Return the model with what it may hold several times numbered from the first."""
    for key in model.effects:
        first = effect(key).after
        if first and first not in model.effects:
            values = {name: value for name, (value, *_) in parameters_of(model, key).items()}
            order = tuple(first if one == key else one for one in model.effects)
            moved = model.without_effect(key).with_effect(first, values, scales)
            return numbered(replace(moved, effects=order), scales)
    return model


def special_case(model: Model, key: str, special: str, scales: Scales) -> Model:
    """Return the model with a special case in the place of an effect, at like values."""
    pairs = effect(key).card.generalises[special]
    shared = {theirs for _, theirs in pairs}
    values = {
        name: float(np.mean([model[f'{key}.{mine}'] for mine, own in pairs if own == name]))
        for name in shared
    }
    order = tuple(special if one == key else one for one in model.effects)
    return replace(model.without_effect(key).with_effect(special, values, scales), effects=order)


def _simpler(rung: Rung, model: Model, bench: Bench, inexact: float = 0.0) -> Rung:
    """Return the fit of a model with fewer parameters, if there is no evidence for more.

    Nor is it evidence if it is less than `inexact`, which is what no law has right to the last
    detail, where the simpler model leaves nothing but noise and runs as well on held-out data.
    """
    weighting = rung.result.weighting
    full, rows = profile_cost(rung, bench, weighting)
    count = len(rung.model.parameters.free) - len(model.parameters.free)
    allowed = bench.threshold + count * float(np.log(rows))
    rough = rough_fit(model, weighting, bench, ROUGH_STEPS, reweight=0)
    if rough.cost - _rough_cost(rung, model, bench) > CLEARLY * allowed:
        return rung
    slim = climb(rough.model, bench, weighting)
    less, _ = profile_cost(slim, bench, weighting)
    if less - full < allowed:
        return rung if less - full > LEAST_CERTAINTY and _proves_itself(rung, slim) else slim
    runs = less < ONLY_NOISE * rows and slim.held.error_percent <= rung.held.error_percent
    does = (less - full < inexact and runs) or _is_trifle(rung, slim, less / rows)
    return slim if does else rung


def _proves_itself(rung: Rung, slim: Rung) -> bool:
    """Whether held-out data, which no fit has seen, fall by much and beyond doubt with an effect.

    They may show what training data hardly do: a winding that warms in them, say.
    """
    gain = gain_percent(slim.held, rung.held)
    return gain > SURE_GAIN and is_certain(slim.held, rung.held, rung.result.weighting)


def _is_trifle(rung: Rung, slim: Rung, excess: float) -> bool:
    """Whether an effect does next to nothing beside others, whatever the evidence for it.

    Without it, in `slim`, the whitened variance is `excess` times that of noise: nothing is left
    to look for.  No law is exact to the last detail, and another one makes up for what is not.
    """
    fewer = len(slim.model.effects) < len(rung.model.effects)
    gain = gain_percent(slim.held, rung.held)
    beside = fewer and bool(slim.model.effects)
    return beside and excess < ONLY_NOISE and gain < MIN_CERTAIN_GAIN_PERCENT


def _rough_cost(rung: Rung, model: Model, bench: Bench) -> float:
    """Return the sum of squares of a fit over the data that a rough fit of `model` looks at."""
    some = replace(bench, train=some_of(bench, model), substeps=min(bench.substeps, FINER))
    problem = some.problem(rung.model)
    there = problem.linearize(problem.vector(), parameters=False)
    return normal_equations(there, rung.result.weighting)[2]
