"""A diagnosis as JSON: schema ``motor_sysid/diagnosis/1`` (docs/diagnosis.md)."""

from motor_sysid.diagnosis.result.curves import ChannelError, Where
from motor_sysid.diagnosis.result.findings_json import (
    curve_document,
    findings_document,
    map_document,
)
from motor_sysid.diagnosis.result.plain import Json, number, numbers
from motor_sysid.diagnosis.result.result import Candidate, Diagnosis, Step
from motor_sysid.diagnosis.result.threshold import Threshold
from motor_sysid.physics.model import Model

SCHEMA = 'motor_sysid/diagnosis/1'


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Json]:
    """Return a diagnosis as a tree of plain values; numbers that do not exist become null."""
    return {
        'schema': SCHEMA,
        'verdict': diagnosis.verdict.value,
        'effects': list(diagnosis.effects),
        'candidates': [_candidate(c) for c in _all_candidates(diagnosis)],
        'steps': [_step(s) for s in diagnosis.steps],
        'noise_floor_percent': number(diagnosis.noise_floor_percent),
        'noise_sigma': {k: number(v) for k, v in diagnosis.noise_sigma.items()},
        'where': [where_document(w) for w in diagnosis.steps[0].where],
        'where_after': [where_document(w) for w in diagnosis.steps[-1].where],
        'curves': [curve_document(c) for c in diagnosis.steps[0].curves],
        'curves_after': [curve_document(c) for c in diagnosis.steps[-1].curves],
        'maps': [map_document(m) for m in diagnosis.steps[0].maps],
        'maps_after': [map_document(m) for m in diagnosis.steps[-1].maps],
        **findings_document(diagnosis),
        'experiment': dict(diagnosis.experiment) if diagnosis.experiment else None,
        'lent': diagnosis.lent,
        'calibration': _threshold(diagnosis.calibration),
        'reasons': list(diagnosis.reasons),
        'warnings': list(diagnosis.warnings),
        'seconds': number(diagnosis.seconds),
    }


def model_parameters(model: Model) -> dict[str, Json]:
    """Return parameter name to value, unit and sigma."""
    return {
        p.name: {
            'value': number(p.value),
            'unit': p.unit,
            'sigma': None if p.sigma is None else number(p.sigma),
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
    named = diagnosis.effects
    return sorted(
        best.values(), key=lambda c: (c.effect not in named, not c.passes, -c.delta_bic)
    )


def _threshold(one: Threshold | None) -> Json:
    if one is None:
        return None
    return {
        'delta_bic': number(one.delta_bic),
        'alpha': one.alpha,
        'limits': [number(limit) for limit in one.limits],
        'runs': one.runs,
        'rate': [number(limit) for limit in one.rate],
        'extrapolated': number(one.extrapolated),
        'words': one.words,
    }


def _candidate(one: Candidate) -> dict[str, Json]:
    return {
        'effect': one.effect,
        'title': one.title,
        'equation': one.equation,
        'law': one.law,
        'delta_bic': number(one.delta_bic),
        'train_error_percent': number(one.train_error_percent),
        'validation_error_percent': number(one.validation_error_percent),
        'parameters': {
            name: {'value': number(value), 'unit': unit, 'sigma': number(sigma)}
            for name, (value, unit, sigma) in one.parameters.items()
        },
        'confusable_with': list(one.confusable_with),
        'passes': one.passes,
        'note': one.note,
    }


def _step(step: Step) -> dict[str, Json]:
    return {
        'effects': list(step.model.effects),
        'train_error_percent': number(step.train_error_percent),
        'validation_error_percent': number(step.validation_error_percent),
        'channel_errors_percent': {k: number(v) for k, v in step.channel_errors.items()},
        'parameters': model_parameters(step.model),
    }


def where_document(where: Where) -> dict[str, Json]:
    """Return one axis of errors as plain values."""
    return {
        'axis': where.axis,
        'unit': where.unit,
        'bins': numbers(where.bins),
        'error_percent': numbers(where.error_percent),
        'error_share': numbers(where.error_share),
        'time_share': numbers(where.time_share),
        'channels': {name: _channel(one) for name, one in where.channels.items()},
    }


def _channel(one: ChannelError) -> dict[str, Json]:
    return {
        'unit': one.unit,
        'overall': number(one.overall),
        'rms': numbers(one.rms),
        'low': numbers(one.low),
        'high': numbers(one.high),
        'chance': number(one.chance),
    }
