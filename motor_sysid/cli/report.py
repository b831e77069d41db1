"""`motor-sysid report`: write the page of a diagnosis as one HTML file."""

import argparse
from dataclasses import replace
from pathlib import Path
import time
from typing import TYPE_CHECKING

from motor_sysid.cli.common import (
    add_effect_file_argument,
    add_reading_arguments,
    load_effect_files,
    progress,
)
from motor_sysid.cli.output import new_page, write_each, write_json, writing
from motor_sysid.cli.reading import load_both
from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.workbench.schema import View

HELP = 'write one self-contained HTML page from a saved diagnosis, or from a model and data'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        'inputs', nargs='+', metavar='INPUT', type=Path,
        help='one saved diagnosis or report (.json), or a MODEL (.yaml) and one or more DATA: '
        'then what the model lacks on them is found first',
    )  # fmt: skip
    parser.add_argument(
        '--validate', nargs='+', action='extend', default=[], metavar='DATA', type=Path,
        help='recordings to judge on; default: the last part of each DATA is held back',
    )  # fmt: skip
    parser.add_argument(
        '-o', '--out', default='report.html', metavar='HTML', type=new_page,
        help='the page to write (default: %(default)s)',
    )  # fmt: skip
    add_reading_arguments(parser)
    add_effect_file_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Write the page and say where it lies."""
    from motor_sysid.workbench.view import load_view

    load_effect_files(args.effect_file)
    saved = len(args.inputs) == 1 and args.inputs[0].suffix == '.json'
    if saved and (args.validate or args.msg_config is not None):
        given = '--validate' if args.validate else '--msg-config'
        raise UserError(
            f'{given} has no effect on {args.inputs[0]}, whose data are in it; leave it out, or '
            'give a model (.yaml) and data'
        )
    view = load_view(args.inputs[0]) if saved else _view_of_model(args)
    write_each(lambda: _write_page(view, args.out), lambda: write_json(view, args.json))
    return 0


def _write_page(view: 'View', path: Path) -> None:
    from motor_sysid.workbench.report import write_view_report

    with writing(path):
        print(f'report: {write_view_report(view, path)}')


def _view_of_model(args: argparse.Namespace) -> 'View':
    """Find what a model lacks on the data, and return the page's view of it."""
    from motor_sysid.cli.diagnose import usual_settings
    from motor_sysid.diagnosis import diagnose
    from motor_sysid.physics.store import load_model
    from motor_sysid.workbench.view import build_view

    model, *data = args.inputs
    if not data:
        raise UserError(
            f'{model} alone makes no report; give one saved diagnosis (.json), or a model (.yaml) '
            'followed by data'
        )
    start = load_model(model)
    train, held = load_both(data, args.validate, args.msg_config)
    began = time.perf_counter()
    found = diagnose(train, held, model=start, settings=usual_settings(), progress=progress())
    return build_view(replace(found, seconds=time.perf_counter() - began))
