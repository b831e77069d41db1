"""From a refitted trial to the candidate that people see, with its evidence curve."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
import inspect

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.refit import parameters_of, Trial
from motor_sysid.diagnosis.residual import known_forces, measured_states
from motor_sysid.diagnosis.result import Candidate, Curve
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]


def candidate_of(
    trial: Trial, curves: Sequence[Curve], rivals: Sequence[str], records: Sequence[Record]
) -> Candidate:
    """Describe a trial."""
    one = trial.scored.variant.effect
    return Candidate(
        effect=one.key,
        title=one.card.title,
        equation=one.card.enters.value,
        law=one.card.equation,
        delta_bic=trial.delta_bic,
        train_error_percent=trial.rung.training.error_percent,
        validation_error_percent=trial.rung.validation.error_percent,
        parameters=parameters_of(trial.rung.model, one.key),
        confusable_with=tuple(rivals),
        passes=trial.passes,
        note=trial.note,
        curve=_curve(trial, curves, records),
    )


def _curve(trial: Trial, curves: Sequence[Curve], records: Sequence[Record]) -> Curve | None:
    """Return the curve on the effect's axis, with the effect's force averaged in the same bins."""
    one = trial.scored.variant.effect
    force = next(iter(one.laws), 'torque')
    wanted = f'unexplained {force}'
    curve = next((c for c in curves if c.axis == one.card.axis and c.quantity == wanted), None)
    if curve is None or force not in one.laws:
        return curve
    law = _law_in_bins(trial.rung.model, one.key, force, curve, records)
    return replace(curve, law=law)


def _law_in_bins(
    model: Model, key: str, force: str, curve: Curve, records: Sequence[Record]
) -> Array | None:
    alone = model
    for other in model.effects:
        if other != key:
            alone = alone.without_effect(other)
    states = [measured_states(alone, record.uniform()) for record in records]
    if any(not _evaluable(alone, key, force, s) for s in states):
        return None
    values = np.concatenate([known_forces(alone, s)[force] for s in states])
    x = np.concatenate([_axis(curve.axis, s) for s in states])
    if curve.axis == 'position' and curve.axis_unit == 'rad':
        x = np.mod(x, 2 * np.pi)
    edges = np.concatenate(([-np.inf], 0.5 * (curve.x[1:] + curve.x[:-1]), [np.inf]))
    place = np.digitize(x, edges) - 1
    count = np.bincount(place, minlength=curve.x.size)
    total = np.bincount(place, weights=values, minlength=curve.x.size)
    mean: Array = total / np.maximum(count, 1)
    return mean


def _axis(axis: str, states: Mapping[str, Array]) -> Array:
    name = {'speed': 'omega', 'position': 'theta', 'current': 'i', 'time': 't'}[axis]
    return states[name]


def _evaluable(model: Model, key: str, force: str, states: Mapping[str, Array]) -> bool:
    from motor_sysid.physics.effects import effect

    one = effect(key)
    asked = set(inspect.signature(one.laws[force]).parameters)
    known = {*states, *model.parameters.values(), *one.card.states}
    return asked <= known | {p.name for p in one.card.parameters}
