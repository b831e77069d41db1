"""The condition of a motor over recordings of different days, against a reference model."""

from collections.abc import Sequence
from dataclasses import dataclass

from motor_sysid.diagnosis.condition.drift import alarms, Drift, drift_of_fit, SCATTER
from motor_sysid.diagnosis.condition.likely import Likely, likely
from motor_sysid.diagnosis.search.bench import look_ahead, prepared
from motor_sysid.estimation.batch import fit, FitResult, make_chain, observed_outputs, Problem
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

ALPHA = 0.01
"""How often a call raises any alarm about a motor that has not changed."""


@dataclass(frozen=True)
class Condition:
    """What one day says.

    Attributes
    ----------
    fit:
        The refit of the reference on that day.
    drift:
        How far its parameters have moved.
    moved:
        Numbers of those that have moved beyond chance.
    causes:
        What explains the change, best first; empty without an alarm, and where nothing of the
        table does.
    """

    fit: FitResult
    drift: Drift
    moved: tuple[int, ...]
    causes: tuple[Likely, ...]

    @property
    def words(self) -> str:
        """What has moved and why, in a sentence."""
        return in_words(self.drift, self.moved, self.causes)


def conditions(
    reference: Model,
    days: Sequence[Sequence[Record]],
    *,
    alpha: float = ALPHA,
    scatter: float = SCATTER,
) -> tuple[Condition, ...]:
    """Refit a reference model on each day, and say which parameters moved and why.

    Parameters
    ----------
    reference:
        The model of the healthy motor, with sigmas.
    days:
        Recordings of each day.
    alpha:
        Chance of any false alarm, over all parameters and days.
    scatter:
        Relative standard deviation of a healthy motor's parameters from day to day.

    Raises
    ------
    UserError
        If the recordings do not fit the motor.
    """
    fits = [_refitted(reference, records) for records in days]
    drifts = [drift_of_fit(reference, one, scatter) for one in fits]
    return tuple(
        Condition(one, drift, tuple(moved), causes_of(reference, drift, moved))
        for one, drift, moved in zip(fits, drifts, alarms(drifts, alpha), strict=True)
    )


def causes_of(reference: Model, drift: Drift, moved: Sequence[int]) -> tuple[Likely, ...]:
    """Return what explains a drift that raised an alarm."""
    return likely(drift, has_brushes(reference)) if moved else ()


def has_brushes(model: Model) -> bool:
    """Whether a motor has brushes: then the effect of their voltage makes sense for it."""
    return model.admits(effect('brush_voltage_drop'))


def in_words(drift: Drift, moved: Sequence[int], causes: Sequence[Likely]) -> str:
    """Return what has moved and why, in a sentence; rivals are told as such."""
    if not drift.parameters:
        return 'nothing could be compared: these data determine no parameter of the model'
    if not moved:
        return 'no parameter has moved beyond chance'
    what = ', '.join(drift.words(k) for k in moved)
    if not causes:
        return f'{what}: no cause of the table explains this; `motor-sysid diagnose` may'
    if len(causes) == 1:
        return f'{what}: {causes[0].words}'
    rivals = '; or '.join(one.words for one in causes)
    return f'{what}: {rivals} (these data cannot tell which)'


def _refitted(reference: Model, records: Sequence[Record]) -> FitResult:
    values, kind = reference.parameters.values(), reference.kind
    evens = prepared(records, reference.motor, values)
    outputs = observed_outputs(kind, evens)
    ahead = look_ahead(kind, values, evens, outputs)
    chains = [make_chain(record, kind, outputs, horizon=ahead) for record in evens]
    return fit(Problem(reference, chains, outputs))
