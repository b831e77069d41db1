"""From a diagnosis to the view: the one object that the page, the report and tests read."""

from collections.abc import Mapping, Sequence
import json
from pathlib import Path
from typing import cast

import numpy as np

from motor_sysid.diagnosis.result.findings import Difference, Unknown
from motor_sysid.diagnosis.result.result import Diagnosis, Verdict
from motor_sysid.errors import UserError
from motor_sysid.physics.effects import effect
from motor_sysid.signals.short_names import short_names
from motor_sysid.workbench.axis import axis_times, decimate, join, pack, Stretch
from motor_sysid.workbench.bench import Bench
from motor_sysid.workbench.channels import Channel, Panel, panels_of
from motor_sysid.workbench.regimes import Bins, Grid, REGIMES
from motor_sysid.workbench.schema import (
    ChannelView,
    DifferenceView,
    MapView,
    Named,
    PanelView,
    RegimesView,
    SCHEMA,
    StretchView,
    UnknownView,
    VerdictView,
    View,
)
from motor_sysid.workbench.steps import curve_view, step_view
from motor_sysid.workbench.words import (
    held_out_words,
    motor_title,
    named,
    number,
    recordings,
    sources_of,
    verdict_title,
    with_titles,
)


def build_view(
    diagnosis: Diagnosis,
    *,
    effects: Sequence[str] = (),
    parents: Sequence[int] | None = None,
    last: int | None = None,
) -> View:
    """Return everything that the page shows of a diagnosis, ready for JSON.

    Parameters
    ----------
    diagnosis:
        What was found; its records become one time axis with the held-out stretch in focus.
    effects:
        Keys of the effects that the page may ask to add where a model has room for them, if
        something answers.
    parents:
        For each step the index of the one that it was made from, -1 for none; by default the one
        before it.
    last:
        Index of the step that the verdict is about; by default the last.

    Raises
    ------
    UserError
        If the diagnosis has no record or no model.
    """
    bench = Bench.of(diagnosis, parents, last)
    records, stretches = diagnosis.records, bench.stretches
    names = short_names(sources_of(records))
    return {
        'schema': SCHEMA,
        'actions': bool(effects),
        'source': recordings(list(names.values())),
        'motor': _motor(diagnosis),
        'held_out': held_out_words(records, diagnosis.roles),
        'verdict': _verdict(diagnosis, bench.titles),
        'noise_floor_percent': number(diagnosis.noise_floor_percent),
        'records': [_stretch(index, bench, names) for index in range(len(records))],
        'time': pack(axis_times(stretches, records), '<f8'),
        'channels': [_channel(channel, bench) for channel in bench.channels],
        'panels': [_panel(panel) for panel in panels_of(bench.channels, bench.primary)],
        'primary': bench.primary,
        'focus': [stretches[bench.held[0]].start, stretches[bench.held[-1]].end],
        'first': _first(diagnosis),
        'last': bench.last,
        'effects': [{'key': key, 'title': effect(key).card.title} for key in effects],
        'regimes': None if bench.regimes is None else _regimes(bench.regimes, stretches),
        'map': None if bench.grid is None else _map(bench.grid, bench),
        'steps': [step_view(index, bench, effects) for index in range(len(diagnosis.steps))],
    }


def save_view(view: View, path: str | Path) -> Path:
    """Write a view as JSON and return the path."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(json.dumps(view, allow_nan=False, separators=(',', ':')), encoding='utf-8')
    return target


def load_view(path: str | Path) -> View:
    """Read a view that `save_view` wrote, or that a saved diagnosis holds.

    Raises
    ------
    UserError
        If the file is neither, or of another version.
    """
    try:
        view = json.loads(Path(path).read_text(encoding='utf-8'), parse_constant=_no_number)
    except (OSError, ValueError) as error:
        raise UserError(f'cannot read the view {path}: {error}') from None
    if isinstance(view, dict) and isinstance(view.get('view'), dict):
        view = view['view']
    schema = view.get('schema') if isinstance(view, dict) else None
    if schema != SCHEMA:
        raise UserError(
            f'{path} has schema {schema!r}, a saved report view has {SCHEMA!r}; '
            '`motor-sysid diagnose DATA --json FILE` and `motor-sysid report MODEL DATA --json '
            'FILE` save one'
        )
    missing = [name for name in ('verdict', 'records', 'time', 'steps') if not view.get(name)]
    if missing:
        raise UserError(f'{path} is no whole view: it lacks {", ".join(missing)}; save it again')
    return cast(View, view)


def _no_number(text: str) -> float:
    raise ValueError(f'{text} is no number of JSON')


def _first(diagnosis: Diagnosis) -> int:
    """Return the model to open with: the base, or the last where something unknown remains."""
    return len(diagnosis.steps) - 1 if diagnosis.verdict is Verdict.UNKNOWN_EFFECT else 0


def _verdict(diagnosis: Diagnosis, titles: dict[str, str]) -> VerdictView:
    return {
        'key': diagnosis.verdict.value,
        'title': verdict_title(diagnosis, titles),
        'effects': [named(key, titles) for key in diagnosis.effects],
        'reasons': list(diagnosis.reasons),
        'warnings': list(diagnosis.warnings),
        'experiment': None
        if diagnosis.experiment is None
        else {key: with_titles(text, titles) for key, text in diagnosis.experiment.items()},
        'seconds': number(diagnosis.seconds),
        'unknown': [_unknown(one) for one in diagnosis.unknown],
        'blind_spots': [
            {'words': one.words, 'remedy': one.remedy} for one in diagnosis.blind_spots
        ],
        'differences': [_difference(one) for one in diagnosis.differences],
    }


def _difference(one: Difference) -> DifferenceView:
    names = short_names(each.record for each in one.values)
    return {
        'name': one.name,
        'description': one.description,
        'unit': one.unit,
        'values': [
            {
                'record': names[each.record],
                'value': number(each.value),
                'low': number(each.low),
                'high': number(each.high),
                'searched': each.searched,
            }
            for each in one.values
        ],
    }


def _unknown(one: Unknown) -> UnknownView:
    return {
        'quantity': one.quantity,
        'axis': one.axis,
        'shape': one.shape,
        'words': one.words,
        'axes': [{'axis': a.axis, 'share': number(a.share), 'best': a.best} for a in one.axes],
        'curve': None if one.curve is None else curve_view(one.curve),
    }


def _motor(diagnosis: Diagnosis) -> Named:
    key = diagnosis.steps[0].model.motor
    return {'key': key, 'title': motor_title(key)}


def _stretch(index: int, bench: Bench, names: Mapping[str, str]) -> StretchView:
    record, stretch = bench.diagnosis.records[index], bench.stretches[index]
    name = names[record.provenance.source]
    return {
        'label': name if len(names) > 1 else '',
        'source': name,
        'role': bench.diagnosis.roles[index],
        'start': stretch.start,
        'end': stretch.end,
        'clock': stretch.clock,
        'samples': len(record),
        'bucket': stretch.size,
        'rate_hz': number(1 / record.dt),
    }


def _panel(panel: Panel) -> PanelView:
    return {
        'key': panel.name,
        'title': panel.name.replace('_', ' '),
        'unit': panel.unit,
        'channels': list(panel.channels),
        'shown': panel.shown,
        'stepped': panel.stepped,
    }


def _channel(channel: Channel, bench: Bench) -> ChannelView:
    parts = [
        decimate(record[channel.name], stretch.size)
        for record, stretch in zip(bench.diagnosis.records, bench.stretches, strict=True)
    ]
    return {
        'key': channel.name,
        'label': channel.label,
        'unit': channel.unit,
        'kind': channel.kind,
        'values': pack(join(parts, np.nan)),
        'sigma': number(bench.diagnosis.noise_sigma.get(channel.name, np.nan)),
    }


def _regimes(regimes: tuple[Bins, ...], stretches: Sequence[Stretch]) -> RegimesView:
    parts = [bins[s.picks] for bins, s in zip(regimes, stretches, strict=True)]
    return {'names': list(REGIMES), 'ids': pack(join(parts, 255), '<u1')}


def _map(grid: Grid, bench: Bench) -> MapView:
    parts = [
        np.where(cells[s.picks] < 0, 65535, cells[s.picks])
        for cells, s in zip(grid.cells, bench.stretches, strict=True)
    ]
    return {
        'x': grid.x,
        'y': grid.y,
        'x_unit': grid.x_unit,
        'y_unit': grid.y_unit,
        'x_edges': [float(f'{edge:.6g}') for edge in grid.x_edges],
        'y_edges': [float(f'{edge:.6g}') for edge in grid.y_edges],
        'ids': pack(join(parts, 65535), '<u2'),
        'counts': pack(bench.held_counts(), '<u4'),
        'scale': bench.sigma if bench.sigma > 0 else 1.0,
        'in_sigma': bench.sigma > 0,
    }
