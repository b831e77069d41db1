"""`motor-sysid monitor`: has a motor changed since its model was made, and why."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from motor_sysid.cli.common import (
    add_effect_file_argument,
    add_reading_arguments,
    load_effect_files,
    number,
)
from motor_sysid.cli.output import write_json
from motor_sysid.cli.reading import load_data, load_first_model
from motor_sysid.signals.short_names import short_names

if TYPE_CHECKING:
    from motor_sysid.diagnosis.condition import Condition
    from motor_sysid.physics.model import Model

HELP = 'say which parameters of a motor have moved since its model was made, and the likely cause'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument('model', type=Path, metavar='MODEL', help='model (YAML) of the good motor')
    parser.add_argument(
        'data', nargs='+', type=Path, metavar='DATA',
        help='one recording for each day: bag folder, .mcap, .db3, CSV, CSV.GZ, .mat or .npz',
    )  # fmt: skip
    add_reading_arguments(parser)
    parser.add_argument(
        '--alpha', type=number('--alpha', 0, 1), default=0.01, metavar='RATE',
        help='chance of any false alarm in all DATA together (default: %(default)g)',
    )  # fmt: skip
    parser.add_argument(
        '--scatter', type=number('--scatter', 0, 1, closed=True), default=0.02, metavar='SHARE',
        help='relative standard deviation by which parameters of a good motor differ from day to '
        'day (default: %(default)g)',
    )  # fmt: skip
    add_effect_file_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Compare, print, write what was asked for."""
    from motor_sysid.diagnosis.condition import conditions

    load_effect_files(args.effect_file)
    reference = load_first_model(args)
    days = [load_data([path], args.msg_config) for path in args.data]
    found = conditions(reference, days, alpha=args.alpha, scatter=args.scatter)
    print('\n'.join(_lines(reference, args.data, found)))
    write_json(_document(args.data, found), args.json)
    return 0


def _lines(reference: 'Model', paths: list[Path], found: 'tuple[Condition, ...]') -> list[str]:
    days = [*short_names(map(str, paths)).values()]
    names = [p.name for p in reference.parameters.free]
    widths = [max(18, len(name) + 2) for name in names]
    heads = ''.join(f'{name:>{width}}' for name, width in zip(names, widths, strict=True))
    lines = [f'{"change in %":<24}{heads}']
    for name_of_day, day in zip(days, found, strict=True):
        places = {p.name: k for k, p in enumerate(day.drift.parameters)}
        cells = [_cell(day, places[name]) if name in places else '-' for name in names]
        row = ''.join(f'{cell:>{width}}' for cell, width in zip(cells, widths, strict=True))
        lines.append(f'{name_of_day[-22:]:<24}{row}')
    lines.append('(! beyond chance; - not watched: an offset, or not determined)')
    for name_of_day, day in zip(days, found, strict=True):
        lines.append(f'{name_of_day}: {day.words}')
        lines += [f'  to tell: {check}' for check in _checks(day)]
    if all(p.sigma is None for p in reference.parameters.free):
        lines.append(
            'note: the reference has no sigmas and counts as exact; make it with `motor-sysid fit`'
        )
    return lines


def _cell(day: 'Condition', k: int) -> str:
    mark = '!' if k in day.moved else ''
    return f'{mark}{day.drift.percent(k):+.2g} ± {100 * float(day.drift.sigma[k]):.2g}'


def _checks(day: 'Condition') -> list[str]:
    checks = [cause.check for one in day.causes for cause in one.causes]
    return list(dict.fromkeys(checks)) if len(day.causes) > 1 else []


def _document(paths: list[Path], found: 'tuple[Condition, ...]') -> dict[str, object]:
    days = []
    for path, day in zip(paths, found, strict=True):
        p_values = day.drift.p_values()
        parameters = {
            p.name: {
                'reference': p.value,
                'value': float(day.drift.values[k]),
                'unit': p.unit,
                'change_percent': float(day.drift.percent(k)),
                'sigma_percent': 100 * float(day.drift.sigma[k]),
                'p_value': float(p_values[k]),
                'alarm': k in day.moved,
            }
            for k, p in enumerate(day.drift.parameters)
        }
        causes = [
            {'causes': [c.words for c in one.causes], 'p_value': one.p_value, 'words': one.words}
            for one in day.causes
        ]
        days.append(
            {'data': str(path), 'watched': bool(day.drift.parameters), 'alarm': bool(day.moved),
             'words': day.words, 'parameters': parameters, 'causes': causes,
             'notes': list(day.fit.warnings)}
        )  # fmt: skip
    return {'schema': 'motor_sysid/monitor/1', 'days': days}
