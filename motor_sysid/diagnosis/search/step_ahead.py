"""One step ahead: effects that do not pass alone, since another one is missing beside them.

What explains nearly all of the training data need not lower the held-out error where the held-out
data show the other effect most: a ramp of speeds tells of losses with speed, and steps of load.
Then the step is made for the time being, and counts if a second effect passes on top of it and the
two together stand all tests against the model before.  Or the effect itself takes the place of
what was there: beside it, base parameters and the speed sensor are what they should be.
"""

from collections.abc import Callable, Sequence

from motor_sysid.diagnosis.result.names import titles
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.further import RESTLESS
from motor_sysid.diagnosis.search.gain import gain_percent, MIN_STEADY, steadiness
from motor_sysid.diagnosis.search.gates import (
    gone,
    HALVED,
    HELD_BACK,
    MIN_FURTHER_GAIN_PERCENT,
    SURE,
    TAKES_OVER,
    UNCERTAIN,
)
from motor_sysid.diagnosis.search.prune import pruned
from motor_sysid.diagnosis.search.ranking import AT_NOISE, RIVAL_BIC, RIVAL_SHARE, winner_of
from motor_sysid.diagnosis.search.rung import leaves_much, profile_cost, Rung, SPOILED
from motor_sysid.diagnosis.search.trial import SURELY_MORE, Trial
from motor_sysid.estimation.batch import Weighting

STEPS = 2
"""Trials, best evidence first, from which a step ahead is made."""

AT_NOISE_OF_DRIVE = 1.5
"""Whitened variance, in units of the noise, that the truth may leave where a current drives an
axis: that is measured, and its noise goes through the motor, as no noise of a sensor does."""


def hopeful(trials: Sequence[Trial], threshold: float) -> list[Trial]:
    """Return the trials, best first, with overwhelming evidence that only held-out data refuse.

    Or that leave nothing of a parameter of the motor: a load that is still missing may do that.
    """
    sure = [t for t in trials if t.delta_bic > SURE * threshold]
    found = [t for t in sure if t.note.startswith(HELD_BACK) or t.note.endswith(TAKES_OVER)]
    return sorted(found, key=lambda t: -t.delta_bic)[:STEPS]


def refused(rung: Rung, trials: Sequence[Trial], bench: Bench) -> list[Trial]:
    """Return the trials that may have been refused for steps that are too coarse for them."""
    waves = fast_waves(trials) if leaves_much(rung, bench, RESTLESS) else []
    return hopeful(trials, bench.threshold) + waves


def steps_from(
    rung: Rung, trials: Sequence[Trial], bench: Bench, weighting: Weighting
) -> list[Trial]:
    """Return the trials from which a step is made, best first.

    None is made from a model that leaves nothing for certain, beside what its integration does
    wrong, but by what halves the training error: a noise model takes all for noise where base
    parameters are far astray.
    """
    cost, rows = profile_cost(rung, bench, weighting)
    possible = hopeful(trials, bench.threshold)
    if cost * (1.0 - bench.wrong) < SURELY_MORE * rows:
        least = HALVED * rung.training.error_percent
        return [t for t in possible if t.rung.training.error_percent < least]
    return possible


def fast_waves(trials: Sequence[Trial]) -> list[Trial]:
    """Return the trial with the most evidence, if it is of a wave over a turn and does not pass.

    Steps that are long for the wave see little of it.  A second set of waves is not asked for: the
    first has had its steps.
    """
    best = max(trials, key=lambda t: t.delta_bic, default=None)
    if best is None or best.key not in best.rung.model.effects:
        return []
    one = best.scored.variant.effect
    waves = bool(one.card.orders) and not one.after
    return [best] if waves and best.note.startswith((UNCERTAIN, *HELD_BACK)) else []


def second_of(further: Sequence[Trial], old: Rung) -> Trial | None:
    """Return what wins on top of a step ahead of `old`, if the two together stand all tests.

    On the way there the error may have risen, so that what held-out data alone refuse counts, too.
    """
    passing = [t for t in further if t.passes]
    refused = [t for t in further if t.note.startswith(HELD_BACK)]
    for trials in (passing, refused):
        if trials:
            winner = winner_of(trials)
            if stands(winner.rung, old, winner.excess):
                return winner
    return None


def stands(new: Rung, old: Rung, excess: float) -> bool:
    """Whether a model with two effects more than `old` leaves only noise where `old` did not.

    And whether it lowers the held-out error enough, and steadily: two steps reach much that one
    does not, the truth and neighbours of it.  `excess` is the whitened variance that it leaves, in
    units of the noise.
    """
    gain = gain_percent(old.held, new.held)
    helps = gain > MIN_FURTHER_GAIN_PERCENT and steadiness(old.held, new.held) > MIN_STEADY
    driven_by_current = ('current',) in new.model.kind.inputs
    most = AT_NOISE_OF_DRIVE if driven_by_current else AT_NOISE
    return helps and excess < most and not gone(new.model, old.model)


def in_its_place(
    both: Rung,
    first: Trial,
    old: Rung,
    bench: Bench,
    weighting: Weighting,
    gains: dict[str, float],
    tell: Callable[[str], None],
) -> Rung | None:
    """Return the fit in which a step ahead takes the place of what `old` had, if it does better.

    Parameters
    ----------
    both:
        The step, fitted in full on top of `old`.
    first:
        The trial that the step was made from.
    bench, weighting:
        The data, and the noise model under which the two are compared.
    gains:
        Gain in BIC of each effect when it was added; that of the step is noted.
    tell:
        Is told of it.
    """
    slim = pruned(both, bench, dict(gains), tell)
    lost = set(both.model.effects) - set(slim.model.effects)
    spoiled = slim.held.error_percent > SPOILED * old.held.error_percent
    if not lost or first.key in lost or spoiled:
        return None
    gain = max(gains.get(key, 0.0) for key in lost)
    less = profile_cost(old, bench, weighting)[0] - profile_cost(slim, bench, weighting)[0]
    if less < max(RIVAL_BIC, RIVAL_SHARE * gain):
        return None
    tell(f'{titles([first.key])} does better than {titles(sorted(lost))}')
    gains[first.key] = gain + less
    return slim
