"""From a finished ladder to its explanation: words, evidence, blind spots."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from motor_sysid.diagnosis import words
from motor_sysid.diagnosis.remainder import Remainder
from motor_sysid.diagnosis.result import Diagnosis, Step


def explained(
    diagnosis: Diagnosis,
    ladder: Sequence[Step],
    left: Remainder,
    rivals: Mapping[str, tuple[str, ...]],
    nominal: Mapping[str, float],
) -> Diagnosis:
    """Return the diagnosis with the words and the evidence of its verdict.

    Parameters
    ----------
    diagnosis:
        Verdict, effects, the steps that are shown, and the records.
    ladder:
        Every rung that was climbed, those of an unnamed explanation included.
    left:
        What remains.
    rivals:
        Effect that was added to the effects that explain the data as well.
    nominal:
        Data-sheet values: parameter to value in SI; may be empty.
    """
    verdict = diagnosis.verdict
    return replace(
        diagnosis,
        reasons=words.reasons(verdict, ladder, left, rivals),
        experiment=words.experiment(verdict, ladder, rivals),
    )
