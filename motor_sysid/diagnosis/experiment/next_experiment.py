"""What to record next, chosen by simulating what is still possible."""

from collections.abc import Mapping, Sequence

from motor_sysid.diagnosis.experiment import suggest_experiment
from motor_sysid.diagnosis.result.result import Verdict
from motor_sysid.diagnosis.search.rung import Rung
from motor_sysid.diagnosis.search.trial import Trial
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record


def next_experiment(
    verdict: Verdict,
    ladder: Sequence[tuple[Rung, list[Trial]]],
    rivals: Mapping[str, tuple[str, ...]],
    records: Sequence[Record],
) -> dict[str, str] | None:
    """Return the experiment that would decide, in words; None where nothing is open.

    Parameters
    ----------
    verdict:
        What the diagnosis says.
    ladder:
        Fits, each with what was tried on top of it.
    rivals:
        Effect that was added to the effects that explain the data as well.
    records:
        Training records.
    """
    if verdict is Verdict.AMBIGUOUS:
        models = _rivals(ladder, rivals)
    elif verdict is Verdict.INSUFFICIENT_DATA:
        models = [ladder[0][0].model]
    else:
        return None
    try:
        made = suggest_experiment(models, records)
    except UserError:  # several inputs: the words have a general advice
        return None
    return made.brief() if made else None


def _rivals(
    ladder: Sequence[tuple[Rung, list[Trial]]], rivals: Mapping[str, tuple[str, ...]]
) -> list[Model]:
    """Return the fits that the last open question is between."""
    for _, trials in reversed(ladder):
        fitted = {trial.key: trial.rung.model for trial in trials if trial.passes}
        for key, others in rivals.items():
            models = [fitted[name] for name in (key, *others) if name in fitted]
            if others and len(models) > 1:
                return models
    return []
