"""One step ahead: effects that do not pass alone, since another one is missing beside them.

What explains nearly all of the training data need not lower the held-out error where the held-out
data show the other effect most: a ramp of speeds tells of losses with speed, and steps of load.
Then the step is made for the time being, and counts if a second effect passes on top of it and the
two together stand all tests against the model before.
"""

from collections.abc import Sequence

from motor_sysid.diagnosis.search.gates import (
    combined_error,
    gone,
    HELD_BACK,
    MIN_FURTHER_GAIN_PERCENT,
    MIN_STEADY,
    steadiness,
    SURE,
    TAKES_OVER,
)
from motor_sysid.diagnosis.search.ranking import AT_NOISE, winner_of
from motor_sysid.diagnosis.search.rung import Rung
from motor_sysid.diagnosis.search.trial import Trial

STEPS = 2
"""Trials, best evidence first, from which a step ahead is made."""


def hopeful(trials: Sequence[Trial], threshold: float) -> list[Trial]:
    """Return the trials, best first, with overwhelming evidence that only held-out data refuse.

    Or that leave nothing of a parameter of the motor: a load that is still missing may do that.
    """
    sure = [t for t in trials if t.delta_bic > SURE * threshold]
    found = [t for t in sure if t.note.startswith(HELD_BACK) or t.note.endswith(TAKES_OVER)]
    return sorted(found, key=lambda t: -t.delta_bic)[:STEPS]


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
    gain = 100 * (1 - combined_error(new.held, old.held))
    helps = gain > MIN_FURTHER_GAIN_PERCENT and steadiness(old.held, new.held) > MIN_STEADY
    return helps and excess < AT_NOISE and not gone(new.model, old.model)
