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
    """Whether something unknown is left, named or not, that only the held-out data show."""
    pairs = zip(found.records, found.roles, strict=True)
    held = sum(len(record) for record, role in pairs if role == 'validate')
    unknown = found.verdict is Verdict.UNKNOWN_EFFECT or found.unknown
    return bool(unknown) and found.held_alone > ONLY_THERE and held > 2 * PIECE


def better_with_half_lent(found: Diagnosis, again: Diagnosis) -> Diagnosis:
    """Return what was found `again` with half of the held-out data lent, if that is better.

    It names more, or the same with nothing unknown beside it, and says how it was found after the
    verdict.
    """
    known, named = set(found.effects), set(again.effects)
    if not (known < named or (known == named and named and not again.unknown)):
        return found
    what = 'all of it' if known else 'it'
    said = (
        f'The training data do not show {what}: what the model leaves is {found.held_alone:.2g} '
        'times as large over the held-out data. So every other piece of these was fitted as well, '
        'and held-out errors are those over the rest. To do: train on such data, too'
    )
    verdict, *others = again.reasons
    return replace(again, lent=True, reasons=(verdict, said, *others))
