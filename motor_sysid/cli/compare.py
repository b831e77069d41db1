"""`motor-sysid compare`: run a model over recordings and say where it fails."""

import argparse
from pathlib import Path

from motor_sysid.cli.common import (
    add_data_arguments,
    add_effect_file_argument,
    load_data,
    load_effect_files,
    write_json,
)

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
    from motor_sysid.physics.store import load_model

    load_effect_files(args.effect_file)
    comparison, where = compare_model(
        load_model(args.model), load_data(args.data, args.msg_config)
    )
    print(f'error {comparison.error_percent:.4g} % (free run from the recorded input)')
    for name, value in comparison.channel_percent.items():
        print(f'  {name:<12}{value:>10.4g} %')
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
        'where': [where_document(w) for w in where],
    }
    write_json(document, args.json)
    return 0
