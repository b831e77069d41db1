"""From a finished ladder to its explanation: words, evidence, blind spots."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from motor_sysid.diagnosis.result.findings import Unknown
from motor_sysid.diagnosis.result.result import Diagnosis, Step, Verdict
from motor_sysid.diagnosis.search.confusable import Compared, rivalries_of
from motor_sysid.diagnosis.verdict import words
from motor_sysid.diagnosis.verdict.blind_spots import blind_spots, undetermined
from motor_sysid.diagnosis.verdict.proof import evidence_of, off_nominal, wrong_parameters
from motor_sysid.diagnosis.where.remainder import Remainder
from motor_sysid.diagnosis.where.unknown import unknown_of
from motor_sysid.diagnosis.where.where import failure_of


def explained(
    diagnosis: Diagnosis,
    ladder: Sequence[Step],
    left: Remainder,
    rivals: Mapping[str, tuple[str, ...]],
    nominal: Mapping[str, float],
    compared: Mapping[tuple[str, str], Compared] | None = None,
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
    compared:
        Effect and rival to what they were compared by, where no rung of the ladder has both.
    """
    verdict = diagnosis.verdict
    named = verdict in (Verdict.EFFECT_MISSING, Verdict.AMBIGUOUS)
    clear = verdict is Verdict.EFFECT_MISSING
    full = replace(
        diagnosis,
        held_alone=left.held_alone,
        unknown=_unknown(diagnosis, left, partly=len(ladder) > 1),
        evidence=evidence_of(ladder, diagnosis.records, left.floor_percent, nominal)
        if named
        else (),
        wrong_parameters=wrong_parameters(ladder[0], ladder[-1]) if clear else (),
        blind_spots=blind_spots(
            ladder[0].model, diagnosis.records, diagnosis.warnings, ladder[-1].model.effects
        ),
        rivalries=rivalries_of(ladder, rivals, diagnosis.records, compared) if named else (),
        experiment=words.experiment(verdict, rivals),
    )
    return replace(full, reasons=tuple(_reasons(full, ladder, left, nominal)))


def _reasons(
    full: Diagnosis, ladder: Sequence[Step], left: Remainder, nominal: Mapping[str, float]
) -> list[str]:
    """Say what was found, most important first."""
    if full.verdict is Verdict.COMPLETE:
        lines = words.complete(ladder[0], left, full.blind_spots)
    elif full.verdict is Verdict.UNKNOWN_EFFECT:
        lines = words.unknown(ladder, left, full.unknown)
    elif full.verdict is Verdict.INSUFFICIENT_DATA:
        names = undetermined(ladder[0].model, full.warnings)
        return words.insufficient(names, full.warnings, full.blind_spots)
    else:
        lines = words.named(ladder, left, full.evidence, full.rivalries, full.unknown)
        lines += words.wrong(full.wrong_parameters)
    shown = full.verdict is not Verdict.UNKNOWN_EFFECT
    last = (ladder[-1] if shown else full.steps[-1]).model
    said = last.kind.remark(last.parameters) if last.kind.remark else ''
    return [*lines, *([said] if said else []), *off_nominal(last, nominal)]


def _unknown(diagnosis: Diagnosis, left: Remainder, *, partly: bool) -> tuple[Unknown, ...]:
    """Return what the last model that is shown lacks, where something does remain.

    What was found and not named may stand for anything, and leave nothing like what is missing, or
    nothing at all: what it explains `partly` is missing in the model that is shown.
    """
    lacks = left.structured or (diagnosis.verdict is Verdict.UNKNOWN_EFFECT and partly)
    if diagnosis.verdict is Verdict.INSUFFICIENT_DATA or not lacks:
        return ()
    records, roles, last = diagnosis.records, diagnosis.roles, diagnosis.steps[-1]
    failure = failure_of(last.model, records, roles, last.predictions)
    return unknown_of(last.model, records, failure, diagnosis.noise_sigma)
