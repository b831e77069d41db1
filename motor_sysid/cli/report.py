"""`motor-sysid report`: write the page of a diagnosis as one HTML file."""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.diagnosis.result import Diagnosis

HELP = 'write one self-contained HTML page from a saved report, or from a model and data'

MODELS = ('.yaml', '.yml')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        'inputs', nargs='+', metavar='INPUT', type=Path,
        help='one saved report (.json), or a MODEL (.yaml) followed by one or more DATA',
    )  # fmt: skip
    parser.add_argument(
        '--validate', nargs='+', default=(), metavar='DATA', type=Path,
        help='recordings to judge the model on; default: the last part of each DATA',
    )  # fmt: skip
    parser.add_argument(
        '--msg-config', metavar='FILE',
        help='which topic or column carries which signal; default: topics of this package, or '
        'headers with units',
    )  # fmt: skip
    parser.add_argument(
        '-o', '--out', default=Path('report.html'), metavar='FILE', type=Path,
        help='the page to write (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument('--json', metavar='FILE', type=Path, help='also save the report as JSON')


def run(args: argparse.Namespace) -> int:
    """Write the page and say where it lies."""
    from motor_sysid.workbench.report import write_view_report
    from motor_sysid.workbench.schema import View
    from motor_sysid.workbench.view import build_view, load_view, save_view

    view: View
    if len(args.inputs) == 1 and args.inputs[0].suffix == '.json':
        view = load_view(args.inputs[0])
    else:
        model, *data = args.inputs
        view = build_view(_diagnose(model, data, args.validate, args.msg_config))
    try:
        if args.json is not None:
            print(save_view(view, args.json))
        print(write_view_report(view, args.out))
    except OSError as error:
        raise UserError(f'{error.filename} cannot be written: {error.strerror}') from None
    return 0


def _diagnose(
    model: Path, data: Sequence[Path], validate: Sequence[Path], msg_config: str | None
) -> 'Diagnosis':
    """Find what a model lacks on the data, starting from it."""
    from motor_sysid.diagnosis.diagnose import diagnose
    from motor_sysid.physics.store import load_model
    from motor_sysid.recording import load

    if model.suffix not in MODELS or not data:
        raise UserError(
            f'{model} alone makes no report; give one saved report (.json), or a model (.yaml) '
            'followed by data'
        )
    start = load_model(model)
    train, held = (
        [record for path in paths for record in load(path, msg_config).records]
        for paths in (data, validate)
    )
    return diagnose(
        train, held, model=start, progress=lambda text: print(text, file=sys.stderr)
    )
