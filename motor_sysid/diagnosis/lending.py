"""Held-out data that are lent to training, where only they show what is missing.

What acts at large currents only, or where a bridge clips, is in the data or is not: a model that
leaves nothing to learn in the training data and fails over the held-out ones lacks something that
no fit to the former can find.  Every other piece of the held-out data is then fitted as well, the
rest judges, and all gates stay as they are.
"""

from dataclasses import replace

from motor_sysid.diagnosis.result.result import Diagnosis, Verdict
from motor_sysid.diagnosis.where.remainder import ONLY_THERE
from motor_sysid.estimation.batch.chains import PIECE


def shows_only_there(found: Diagnosis) -> bool:
    """Whether something unknown is missing that held-out data show and training data do not."""
    pairs = zip(found.records, found.roles, strict=True)
    held = sum(len(record) for record, role in pairs if role == 'validate')
    unknown = found.verdict is Verdict.UNKNOWN_EFFECT
    return unknown and found.held_alone > ONLY_THERE and held > 2 * PIECE


def better_with_half_lent(found: Diagnosis, again: Diagnosis) -> Diagnosis:
    """Return what was found `again` with half of the held-out data lent, if that names something.

    It says how it was found, after the verdict.
    """
    if again.verdict not in (Verdict.EFFECT_MISSING, Verdict.AMBIGUOUS):
        return found
    said = (
        'The training data do not show it: what the model leaves is '
        f'{found.held_alone:.2g} times as large over the held-out data. So every other piece of '
        'these was fitted as well, and held-out errors are those over the rest. To do: train on '
        'such data, too'
    )
    verdict, *others = again.reasons
    return replace(again, lent=True, reasons=(verdict, said, *others))
