"""`motor-sysid compare`: run a model over recordings and say where it fails."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from motor_sysid.cli.common import (
    add_data_arguments,
    add_effect_file_argument,
    add_hold_back,
    HOLD_BACK,
    load_effect_files,
    progress,
)
from motor_sysid.cli.output import write_json
from motor_sysid.cli.reading import load_data, load_first_model
from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.diagnosis.where.compare import Comparison
    from motor_sysid.physics.model import Model
    from motor_sysid.signals.record import Record

HELP = 'compare a model with recordings: errors by channel, and where it fails'

_WAYS = {-1: 'in backward motion', 0: 'at rest', 1: 'in forward motion'}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument('model', type=Path, metavar='MODEL', help='model (YAML)')
    add_data_arguments(parser)
    add_effect_file_argument(parser)
    parser.add_argument(
        '--ceiling', nargs='*', metavar='STRUCTURE',
        help='also fit black-box structures (all, or those named: tf, arx, ...) to the first part '
        'of DATA, and say how much of what any of them explains in the rest the model explains',
    )  # fmt: skip
    add_hold_back(parser, 'part of each DATA that --ceiling judges on', None)


def run(args: argparse.Namespace) -> int:
    """Compare and print."""
    from motor_sysid.diagnosis.fitting import compare_model
    from motor_sysid.diagnosis.learn import beyond_range
    from motor_sysid.diagnosis.result.document import SCHEMA, where_document
    from motor_sysid.diagnosis.search.motor_kind import passed_over
    from motor_sysid.estimation.batch import observed_outputs
    from motor_sysid.signals.phases import with_third_current

    _check_ceiling(args)
    load_effect_files(args.effect_file)
    model = load_first_model(args)
    records = load_data(args.data, args.msg_config)
    comparison, where = compare_model(model, records)
    print(f'error {comparison.error_percent:.4g} % (free run from the recorded input)')
    errors = _metrics(comparison, records[0].dt)
    for name, value in comparison.channel_percent.items():
        of = errors[name]
        share = f'{value:.4g} %' if math.isfinite(value) else 'at rest'
        unit = next((r.units[name] for r in records if name in r), '')
        print(
            f'  {name:<12}{share:>12}   RMS {of["rmse"]:.4g} {unit}, largest '
            f'{of["largest"]:.4g} {unit}, fit {of["fit_percent"]:.2f} %'
        )
    for one in where:
        worst = max(range(len(one.error_share)), key=lambda k: one.error_share[k])
        low, high = one.bins[worst : worst + 2]
        place = f'between {low:.3g} and {high:.3g} {one.unit}'
        if one.axis == 'direction':
            place = _WAYS[round((low + high) / 2)]
        print(
            f'by {one.axis}: {100 * one.error_share[worst]:.0f} % of the squared error lies '
            f'{place}, in {100 * one.time_share[worst]:.0f} % of the time'
        )
    whole = [with_third_current(record) for record in records]
    unused = passed_over(whole, lambda some: set(observed_outputs(model.kind, some)))
    for note in (*beyond_range(model, records), *unused):
        print(f'note: {note}')
    document: dict[str, object] = {
        'schema': SCHEMA.replace('diagnosis', 'comparison'),
        'error_percent': comparison.error_percent,
        'channel_errors_percent': dict(comparison.channel_percent),
        'metrics': errors,
        'where': [where_document(w) for w in where],
    }
    if args.ceiling is not None:
        hold_back = args.hold_back or HOLD_BACK
        document['ceiling'] = _ceiling(model, records, args.ceiling, hold_back)
    write_json(document, args.json)
    return 0


def _check_ceiling(args: argparse.Namespace) -> None:
    """Refuse structures that there are not, and what does nothing without any."""
    if args.ceiling is None and args.hold_back is not None:
        raise UserError('--hold-back is the part that --ceiling judges on; give that, too')
    if args.ceiling:
        from motor_sysid.structures import known_kind

        for key in args.ceiling:
            known_kind(key)


def _ceiling(
    model: 'Model', records: 'list[Record]', kinds: list[str], hold_back: float
) -> dict[str, object]:
    """Fit structures, print what they explain, and return it for JSON."""
    from motor_sysid.diagnosis.ceiling import ceiling, ceiling_document, words
    from motor_sysid.structures import KINDS

    found = ceiling(
        model, records, kinds=kinds or tuple(KINDS), hold_back=hold_back, progress=progress()
    )
    print('\n'.join(words(found)))
    return ceiling_document(found)


def _metrics(comparison: 'Comparison', dt: float) -> dict[str, dict[str, float]]:
    """Return the errors of every output over all records, one after the other."""
    from dataclasses import asdict

    import numpy as np

    from motor_sysid.signals.metrics import metrics

    measured, left = (np.concatenate(v) for v in (comparison.measured, comparison.residuals))
    time = np.linspace(0.0, dt * (len(measured) - 1), len(measured))
    return {
        name: asdict(metrics(measured[:, j], (measured - left)[:, j], time))
        for j, name in enumerate(comparison.channel_percent)
    }
