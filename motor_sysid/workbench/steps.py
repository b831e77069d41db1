"""What the page shows of one model of the ladder."""

from collections.abc import Iterable, Mapping, Sequence
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.candidates.variants import refusal
from motor_sysid.diagnosis.result.curves import ChannelError, Curve, Map, Where
from motor_sysid.diagnosis.result.result import Candidate
from motor_sysid.physics.effects import effect
from motor_sysid.physics.parameters import Parameter
from motor_sysid.workbench.axis import decimate, join, pack
from motor_sysid.workbench.bench import Bench
from motor_sysid.workbench.regimes import FEWEST, REGIMES, rms_by
from motor_sysid.workbench.schema import (
    CandidateView,
    ChannelErrorView,
    CurveView,
    MapLayer,
    ParameterView,
    RegimeShare,
    StepView,
    WhereView,
)
from motor_sysid.workbench.words import named, number

Array = NDArray[np.float64]


def step_view(index: int, bench: Bench, offered: Sequence[str]) -> StepView:
    """Return what the page shows of model M`index`, which may take of what is offered."""
    step = bench.diagnosis.steps[index]
    parent = bench.parents[index]
    before = bench.diagnosis.steps[max(parent, 0)].model.effects
    floor = bench.diagnosis.noise_floor_percent
    error = step.validation_error_percent
    effects = step.model.effects
    return {
        'name': f'M{index}',
        'parent': parent if parent >= 0 else None,
        'effects': [named(key, bench.titles) for key in effects],
        'added': [named(key, bench.titles) for key in effects if key not in before],
        'train_error_percent': number(step.train_error_percent),
        'validation_error_percent': number(error),
        'times_floor': number(error / floor) if floor > 0 else None,
        'channel_errors': {name: number(value) for name, value in step.channel_errors.items()},
        'model': _traces(index, bench, error=False),
        'error': _traces(index, bench, error=True),
        'map': _map_values(index, bench),
        'regimes': _regime_shares(index, bench),
        'where': [_where(where) for where in step.where],
        'curves': [curve_view(curve) for curve in step.curves],
        'maps': [_layer(drawn) for drawn in step.maps],
        'candidates': _candidates(index, bench),
        'parameters': _parameters(index, bench),
        'addable': [key for key in offered if not refusal(step.model, effect(key))],
    }


def curve_view(curve: Curve) -> CurveView:
    """Return a curve with packed arrays."""
    return {
        'axis': curve.axis,
        'axis_unit': curve.axis_unit,
        'quantity': curve.quantity,
        'unit': curve.unit,
        'x': pack(curve.x),
        'mean': pack(curve.mean),
        'band': pack(curve.band),
        'law': None if curve.law is None else pack(curve.law),
        'chance': number(curve.chance),
    }


def _traces(index: int, bench: Bench, error: bool) -> dict[str, str]:
    """Return the packed points of the model's outputs, or of their errors."""
    packed: dict[str, str] = {}
    for channel in bench.channels:
        parts = [_trace(index, k, channel.name, bench, error) for k in range(len(bench.stretches))]
        if channel.kind == 'output' and any(np.isfinite(part).any() for part in parts):
            packed[channel.name] = pack(join(parts, np.nan))
    return packed


def _trace(index: int, k: int, name: str, bench: Bench, error: bool) -> Array:
    values = (
        bench.error(index, k, name)
        if error
        else bench.diagnosis.steps[index].predictions[k].get(name)
    )
    if values is None:
        values = np.full(len(bench.diagnosis.records[k]), np.nan)
    return decimate(values, bench.stretches[k].size)


def _map_values(index: int, bench: Bench) -> str | None:
    if bench.grid is None:
        return None
    rows, columns = bench.grid.shape
    cells = np.concatenate([bench.grid.cells[k] for k in bench.held])
    rms, count = rms_by(cells, bench.held_errors(index, bench.primary), rows * columns)
    scale = bench.sigma if bench.sigma > 0 else 1.0
    return pack(np.where(count >= FEWEST, rms / scale, np.nan))


def _regime_shares(index: int, bench: Bench) -> list[RegimeShare]:
    if bench.regimes is None:
        return []
    bins = np.concatenate([bench.regimes[k] for k in bench.held])
    rms, count = rms_by(bins, bench.held_sizes(index), len(REGIMES))
    squares = np.nan_to_num(rms) ** 2 * count
    times = np.bincount(bins, minlength=len(REGIMES)) / len(bins)
    total = squares.sum() if np.isfinite(rms).any() else np.nan
    return [
        {
            'name': name,
            'error_share': number(squares[k] / total if total != 0.0 else 0.0),
            'time_share': number(times[k]),
            'error_percent': number(100 * rms[k]),
        }
        for k, name in enumerate(REGIMES)
    ]


def _where(where: Where) -> WhereView:
    return {
        'axis': where.axis,
        'unit': where.unit,
        'bins': _numbers(where.bins),
        'error_percent': _numbers(where.error_percent),
        'error_share': _numbers(where.error_share),
        'time_share': _numbers(where.time_share),
        'channels': {name: _channel_error(one) for name, one in where.channels.items()},
    }


def _channel_error(one: ChannelError) -> ChannelErrorView:
    return {
        'unit': one.unit,
        'overall': number(one.overall),
        'rms': _numbers(one.rms),
        'low': _numbers(one.low),
        'high': _numbers(one.high),
        'chance': number(one.chance),
    }


def _layer(drawn: Map) -> MapLayer:
    return {
        'quantity': drawn.quantity,
        'unit': drawn.unit,
        'x': drawn.x_axis,
        'x_unit': drawn.x_unit,
        'y': drawn.y_axis,
        'y_unit': drawn.y_unit,
        'x_edges': _numbers(drawn.x_edges),
        'y_edges': _numbers(drawn.y_edges),
        'value': pack(drawn.value),
        'band': pack(drawn.band),
    }


def _candidates(index: int, bench: Bench) -> list[CandidateView]:
    """Return what was tried: first what was taken, then the rest as it was ranked."""
    found = [_candidate(c, index, bench) for c in bench.diagnosis.steps[index].candidates]
    return sorted(found, key=lambda candidate: not candidate['added'])


def _candidate(candidate: Candidate, index: int, bench: Bench) -> CandidateView:
    refitted = bool(candidate.parameters)
    taken = _taken(candidate.effect, index, bench)
    return {
        'effect': candidate.effect,
        'title': candidate.title,
        'equation': candidate.equation,
        'law': candidate.law,
        'delta_bic': number(candidate.delta_bic),
        'train_error_percent': number(candidate.train_error_percent) if refitted else None,
        'validation_error_percent': number(candidate.validation_error_percent)
        if refitted
        else None,
        'parameters': [
            {'name': name, 'value': number(value), 'unit': unit, 'sigma': number(sigma)}
            for name, (value, unit, sigma) in candidate.parameters.items()
        ],
        'confusable_with': [named(key, bench.titles) for key in candidate.confusable_with],
        'passes': candidate.passes,
        'note': candidate.note,
        'curve': None if candidate.curve is None else curve_view(candidate.curve),
        'added': '' if taken is None else f'M{taken}',
        'by_hand': taken is not None and taken > bench.last,
    }


def _taken(key: str, index: int, bench: Bench) -> int | None:
    """Return the first model that was made by adding an effect to model `index`."""
    effects = [step.model.effects for step in bench.diagnosis.steps]
    children = (k for k, parent in enumerate(bench.parents) if parent == index)
    return next((k for k in children if key in effects[k] and key not in effects[index]), None)


def _parameters(index: int, bench: Bench) -> list[ParameterView]:
    model, base = (bench.diagnosis.steps[k].model for k in (index, 0))
    before = {parameter.name: parameter.value for parameter in base.parameters}
    return [
        _parameter(parameter, before, bench.titles, index > 0) for parameter in model.parameters
    ]


def _parameter(
    parameter: Parameter, before: Mapping[str, float], titles: dict[str, str], changed: bool
) -> ParameterView:
    effect, _, name = parameter.name.rpartition('.')
    sigma = parameter.sigma
    return {
        'name': name,
        'effect': titles.get(effect, effect),
        'description': parameter.description,
        'value': number(parameter.value),
        'sigma': None if sigma is None else number(sigma),
        'known': sigma is None or math.isfinite(sigma),
        'unit': parameter.unit,
        'free': parameter.free,
        'on_bound': parameter.free and parameter.on_bound,
        'base': number(before[parameter.name]) if changed and parameter.name in before else None,
    }


def _numbers(values: Iterable[float]) -> list[float | None]:
    return [number(value) for value in values]
