"""What a fit and a diagnosis begin with: records prepared alike, and the kind of their motor."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from motor_sysid.diagnosis.search.bench import prepared_parts
from motor_sysid.diagnosis.search.motor_kind import (
    choose_kind,
    refuse_mixed,
    refuse_other_kind,
    remarks,
    told_kind,
)
from motor_sysid.diagnosis.search.rotor_axes import axes_told, words_of_axes
from motor_sysid.diagnosis.search.standstill import refuse_model_at_rest
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.base import Motor
from motor_sysid.signals.doctor import seen_by_fits
from motor_sysid.signals.record import Record


class Ready(NamedTuple):
    """Records that a fit can begin with.

    Attributes
    ----------
    records, held:
        Training and validation records, prepared.
    kind:
        The kind of their motor.
    nominal:
        Parameter name to value in SI: those that were given, and those that records tell.
    notes:
        What is to be said of the data.
    """

    records: list[Record]
    held: list[Record]
    kind: Motor
    nominal: Mapping[str, float]
    notes: tuple[str, ...]


def ready(
    train: Sequence[Record],
    validation: Sequence[Record],
    model: Model | None,
    wanted: str | None,
    nominal: Mapping[str, float],
) -> Ready:
    """Prepare records for a given model, or for a motor kind that is wanted or told by them.

    Raises
    ------
    UserError
        If no kind fits them, they are not of one motor, or the model does not fit them.
    """
    asked = model.motor if model else wanted
    known = model.parameters.values() if model else nominal
    told_by = told_kind([*train, *validation], asked, known)
    angle = axes_told([*train, *validation], told_by, known)
    records, held = prepared_parts(train, validation, told_by, {**known, **angle})
    every = [*records, *held]
    kind = choose_kind(every, told_by)
    refuse_mixed(kind, every)
    refuse_other_kind(kind, model)
    refuse_model_at_rest(model, records)
    notes = seen_by_fits([*train, *validation]) + words_of_axes(angle)
    return Ready(records, held, kind, {**nominal, **angle}, notes + remarks(kind, every, asked))
