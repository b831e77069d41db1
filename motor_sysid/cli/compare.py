"""`motor-sysid compare`: run a model over recordings and say where it fails."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from motor_sysid.cli.common import (
    add_data_arguments,
    add_effect_file_argument,
    load_data,
    load_effect_files,
    write_json,
)

if TYPE_CHECKING:
    from motor_sysid.diagnosis.compare import Comparison

HELP = 'compare a model with recordings: errors by channel, and where it fails'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument('model', type=Path, metavar='MODEL', help='model (YAML)')
    add_data_arguments(parser)
    add_effect_file_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Compare and print."""
    from motor_sysid.diagnosis.document import SCHEMA, where_document
    from motor_sysid.diagnosis.fitting import compare_model
    from motor_sysid.diagnosis.plain import number
    from motor_sysid.physics.store import load_model

    load_effect_files(args.effect_file)
    records = load_data(args.data, args.msg_config)
    comparison, where = compare_model(load_model(args.model), records)
    print(f'error {comparison.error_percent:.4g} % (free run from the recorded input)')
    errors = _metrics(comparison, records[0].dt)
    for name, value in comparison.channel_percent.items():
        of = errors[name]
        print(
            f'  {name:<12}{value:>10.4g} %   RMS {of["rmse"]:.4g}, largest {of["largest"]:.4g}, '
            f'fit {of["fit_percent"]:.2f} %'
        )
    for one in where:
        worst = max(range(len(one.error_share)), key=lambda k: one.error_share[k])
        print(
            f'by {one.axis}: {100 * one.error_share[worst]:.0f} % of the squared error lies '
            f'between {one.bins[worst]:.3g} and {one.bins[worst + 1]:.3g} {one.unit}, '
            f'in {100 * one.time_share[worst]:.0f} % of the time'
        )
    document = {
        'schema': SCHEMA.replace('diagnosis', 'comparison'),
        'error_percent': comparison.error_percent,
        'channel_errors_percent': dict(comparison.channel_percent),
        'metrics': {n: {k: number(v) for k, v in of.items()} for n, of in errors.items()},
        'where': [where_document(w) for w in where],
    }
    write_json(document, args.json)
    return 0


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
