"""A diagnosis as JSON: schema ``motor_sysid/diagnosis/1`` (docs/diagnosis.md)."""

import math
from typing import TypeAlias

import numpy as np

from motor_sysid.diagnosis.result import Candidate, Diagnosis, Step, Where
from motor_sysid.physics.model import Model

SCHEMA = 'motor_sysid/diagnosis/1'

Json: TypeAlias = 'dict[str, Json] | list[Json] | str | float | int | bool | None'


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Json]:
    """Return a diagnosis as a tree of plain values; numbers that do not exist become null."""
    return {
        'schema': SCHEMA,
        'verdict': diagnosis.verdict.value,
        'effects': list(diagnosis.effects),
        'candidates': [_candidate(c) for c in _all_candidates(diagnosis)],
        'steps': [_step(s) for s in diagnosis.steps],
        'noise_floor_percent': _number(diagnosis.noise_floor_percent),
        'noise_sigma': {k: _number(v) for k, v in diagnosis.noise_sigma.items()},
        'where': [where_document(w) for w in diagnosis.steps[0].where],
        'where_after': [where_document(w) for w in diagnosis.steps[-1].where],
        'experiment': dict(diagnosis.experiment) if diagnosis.experiment else None,
        'reasons': list(diagnosis.reasons),
        'warnings': list(diagnosis.warnings),
        'seconds': _number(diagnosis.seconds),
    }


def model_parameters(model: Model) -> dict[str, Json]:
    """Return parameter name to value, unit and sigma."""
    return {
        p.name: {
            'value': _number(p.value),
            'unit': p.unit,
            'sigma': None if p.sigma is None else _number(p.sigma),
            'free': p.free,
        }
        for p in model.parameters
    }


def _all_candidates(diagnosis: Diagnosis) -> list[Candidate]:
    """Return every effect once, with the evidence of the round in which it was strongest."""
    best: dict[str, Candidate] = {}
    for step in diagnosis.steps:
        for one in step.candidates:
            known = best.get(one.effect)
            if known is None or (one.passes, one.delta_bic) > (known.passes, known.delta_bic):
                best[one.effect] = one
    return sorted(best.values(), key=lambda c: (not c.passes, -c.delta_bic))


def _candidate(one: Candidate) -> dict[str, Json]:
    return {
        'effect': one.effect,
        'title': one.title,
        'equation': one.equation,
        'law': one.law,
        'delta_bic': _number(one.delta_bic),
        'train_error_percent': _number(one.train_error_percent),
        'validation_error_percent': _number(one.validation_error_percent),
        'parameters': {
            name: {'value': _number(value), 'unit': unit, 'sigma': _number(sigma)}
            for name, (value, unit, sigma) in one.parameters.items()
        },
        'confusable_with': list(one.confusable_with),
        'passes': one.passes,
        'note': one.note,
    }


def _step(step: Step) -> dict[str, Json]:
    return {
        'effects': list(step.model.effects),
        'train_error_percent': _number(step.train_error_percent),
        'validation_error_percent': _number(step.validation_error_percent),
        'channel_errors_percent': {k: _number(v) for k, v in step.channel_errors.items()},
        'parameters': model_parameters(step.model),
    }


def where_document(where: Where) -> dict[str, Json]:
    """Return one axis of errors as plain values."""
    return {
        'axis': where.axis,
        'unit': where.unit,
        'bins': [_number(v) for v in where.bins],
        'error_percent': [_number(v) for v in where.error_percent],
        'error_share': [_number(v) for v in where.error_share],
        'time_share': [_number(v) for v in where.time_share],
    }


def _number(value: float | np.floating) -> float | None:
    number = float(value)
    return number if math.isfinite(number) else None
