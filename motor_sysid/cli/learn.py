"""`motor-sysid learn`: give a model a law from data for what no known effect explains."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from motor_sysid.cli.common import (
    add_data_arguments,
    add_effect_file_argument,
    load_effect_files,
    progress,
)
from motor_sysid.cli.output import new_file, write_each, write_json, write_model
from motor_sysid.cli.reading import load_parts, load_start

if TYPE_CHECKING:
    from motor_sysid.diagnosis.learn import Learned

HELP = 'where the diagnosis finds an unknown effect: learn its law, and keep it if it predicts'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    add_data_arguments(parser, validate=True)
    parser.add_argument('--model', type=Path, metavar='MODEL', help='model (YAML) to start from')
    parser.add_argument('--motor', metavar='KIND', help='motor kind; default: what the data allow')
    parser.add_argument(
        '--nominal', type=Path, metavar='DATASHEET', help='data sheet (YAML) with nominal values'
    )
    parser.add_argument(
        '--beyond', choices=('hold', 'zero'), default='hold',
        help='what the law is beyond the range of the data (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '-o', '--out', type=new_file, metavar='MODEL',
        help='write the model (YAML); not written where the law is refused',
    )  # fmt: skip
    add_effect_file_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Diagnose, learn, say what came of it."""
    from motor_sysid.cli.diagnose import usual_settings
    from motor_sysid.cli.fit import rung_lines
    from motor_sysid.diagnosis.learn import learn

    load_effect_files(args.effect_file)
    start = load_start(args)
    train, held = load_parts(args, start.k_e)
    found = learn(
        train,
        held,
        motor=start.motor,
        model=start.model,
        nominal=start.nominal,
        hold=args.beyond == 'hold',
        settings=replace(usual_settings(), validation_fraction=args.hold_back),
        progress=progress(),
    )
    if found.unknown is not None:
        print(found.unknown.words)
    if found.model is not None and found.after is not None:
        print('\n'.join(rung_lines(found.model, found.after.result.reason)))
    print(found.reason)
    write_each(
        lambda: write_model(found.model, args.out),
        lambda: write_json(_document(found), args.json),
    )
    return 0


def _document(found: 'Learned') -> dict[str, object]:
    from motor_sysid.diagnosis.result.document import model_parameters

    errors = [
        rung.validation.error_percent for rung in (found.before, found.after) if rung is not None
    ]
    return {
        'schema': 'motor_sysid/learn/1',
        'verdict': found.diagnosis.verdict.value if found.diagnosis else '',
        'learned': found.model is not None,
        'reason': found.reason,
        'axis': found.unknown.axis if found.unknown else '',
        'equation': found.unknown.equation if found.unknown else '',
        'validation_error_percent': errors,
        'parameters': model_parameters(found.model) if found.model else {},
    }
