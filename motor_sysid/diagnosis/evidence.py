"""From a refitted trial to the candidate that people see, with its evidence curve."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.refit import parameters_of, Trial
from motor_sysid.diagnosis.residual import balance, lacking_name, measured_states
from motor_sysid.diagnosis.result import Candidate, Curve
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]


_STATE = {'speed': 'omega', 'position': 'theta', 'current': 'i', 'time': 't'}


def candidate_of(
    trial: Trial,
    base: Model,
    curves: Sequence[Curve],
    rivals: Sequence[str],
    records: Sequence[Record],
) -> Candidate:
    """Describe a trial of an effect on the base model."""
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
        curve=_curve(trial, base, curves, records),
    )


def _curve(
    trial: Trial, base: Model, curves: Sequence[Curve], records: Sequence[Record]
) -> Curve | None:
    """Return the curve on the effect's axis, and what the refitted model says it should be."""
    one = trial.scored.variant.effect
    forces = [f.name for f in base.kind.forces]
    force = next((name for name in one.laws if name in forces), forces[0])
    wanted = lacking_name(base, force)
    curve = next((c for c in curves if c.axis == one.card.axis and c.quantity == wanted), None)
    if curve is None or trial.rung.model is base:
        return curve
    return replace(curve, law=_law_in_bins(base, trial.rung.model, force, curve, records))


def _law_in_bins(
    base: Model, refitted: Model, force: str, curve: Curve, records: Sequence[Record]
) -> Array | None:
    """Average, in the bins of the curve, the force that the base lacks if the refit is right.

    It holds what the effect does less what the base parameters had taken over of it.
    """
    parts, places = [], []
    for record in records:
        states = measured_states(base, record.uniform())
        old, new = balance(base, states), balance(refitted, states)
        if force not in old or force not in new:
            return None
        parts.append((new[force][0] - old[force][0]) / old[force][1])
        places.append(states[_STATE[curve.axis]])
    x = np.concatenate(places)
    if curve.axis == 'position' and curve.axis_unit == 'rad':
        x = np.mod(x, 2 * np.pi)
    edges = np.concatenate(([-np.inf], 0.5 * (curve.x[1:] + curve.x[:-1]), [np.inf]))
    place = np.digitize(x, edges) - 1
    count = np.bincount(place, minlength=curve.x.size)
    total = np.bincount(place, weights=np.concatenate(parts), minlength=curve.x.size)
    mean: Array = total / np.maximum(count, 1)
    return mean
