"""Held-out data that are lent to training, where only they show what is missing.

What acts at large currents only, or where a bridge clips, is in the data or is not: a model that
leaves nothing to learn in the training data and fails over the held-out ones lacks something that
no fit to the former can find.  An effect that the training data ask for fails the held-out ones
as well where something else makes far larger errors there.  Every other piece of the held-out
data is then fitted, too, the rest judges, and all gates stay as they are.
"""

from dataclasses import replace

import numpy as np

from motor_sysid.diagnosis.result.result import Diagnosis, Verdict
from motor_sysid.diagnosis.search.gates import HELD_BACK
from motor_sysid.diagnosis.where.remainder import ONLY_THERE
from motor_sysid.estimation.batch.chains import PIECE
from motor_sysid.signals.metrics import sizes_of

MOST_OF_IT = 0.5
"""Training error beyond sensor noise that an effect leaves, in units of that without it, if the
data ask for it."""

DROWNED = 2.0
"""Held-out error, in units of the training error, that drowns what such an effect brings."""


LEAVES_HALF = 0.5
"""Held-out error that other effects must leave, in units of what those leave that were named."""


def shows_only_there(found: Diagnosis) -> bool:
    """Whether something unknown is left, named or not, that only the held-out data show."""
    pairs = zip(found.records, found.roles, strict=True)
    held = sum(len(record) for record, role in pairs if role == 'validate')
    unknown = found.verdict is Verdict.UNKNOWN_EFFECT or found.unknown
    far = found.held_alone > ONLY_THERE or drowned(found) > DROWNED
    return bool(unknown) and far and held > 2 * PIECE


def drowned(found: Diagnosis) -> float:
    """Return how far an effect is drowned over the held-out data that the training data ask for.

    That is how many times larger the error is there that it leaves; 1 if there is no such effect.
    """
    last, noise = found.steps[-1], _training_noise(found)
    most = MOST_OF_IT**2 * (last.train_error_percent**2 - noise**2) + noise**2
    return max(
        (
            one.validation_error_percent / one.train_error_percent
            for one in last.candidates
            if one.note.startswith(HELD_BACK) and 0.0 < one.train_error_percent**2 < most
        ),
        default=1.0,
    )


def _training_noise(found: Diagnosis) -> float:
    """Return the error that sensor noise alone makes over the training data, in percent."""
    pairs = zip(found.records, found.roles, strict=True)
    train = [record for record, role in pairs if role == 'train']
    names = list(found.noise_sigma)
    if not names:
        return 0.0
    sizes = sizes_of(names, [np.column_stack([r[name] for name in names]) for r in train])
    shares = np.array([*found.noise_sigma.values()]) / np.maximum(sizes, 1e-300)
    return float(100 * np.sqrt(np.mean(shares**2)))


def better_with_half_lent(found: Diagnosis, again: Diagnosis) -> Diagnosis:
    """Return what was found `again` with half of the held-out data lent, if that is better.

    It names more, or the same with nothing unknown beside it, or other effects, no more of them,
    that leave nothing unknown and half of the error at most; and it says how it was found after
    the verdict.
    """
    known, named = set(found.effects), set(again.effects)
    errors = [one.steps[-1].validation_error_percent for one in (found, again)]
    instead = len(named) <= len(known) and errors[1] < LEAVES_HALF * errors[0]
    whole = bool(named) and not again.unknown and (known == named or instead)
    if not (known < named or whole):
        return found
    times = max(found.held_alone, drowned(found))
    what = 'all of it' if known or times > found.held_alone else 'it'
    said = (
        f'The training data do not show {what}: what is left is {times:.2g} times as large over '
        'the held-out data as it need be. So every other piece of these was fitted as well, and '
        'held-out errors are those over the rest. To do: train on such data, too'
    )
    verdict, *others = again.reasons
    return replace(again, lent=True, reasons=(verdict, said, *others))
