"""`motor-sysid fit`: fit a model to recordings."""

import argparse
from pathlib import Path

from motor_sysid.cli.common import (
    add_data_arguments,
    add_effect_file_argument,
    load_data,
    load_effect_files,
    write_json,
)
from motor_sysid.errors import UserError

HELP = 'fit the parameters of a model to recordings'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    add_data_arguments(parser, validate=True)
    parser.add_argument('--model', type=Path, metavar='MODEL', help='model (YAML) to start from')
    parser.add_argument('--motor', metavar='KIND', help='motor kind; default: what the data allow')
    parser.add_argument('--nominal', type=Path, metavar='DATASHEET', help='nominal values (YAML)')
    parser.add_argument(
        '--effect', nargs='+', default=[], metavar='EFFECT', help='effects to fit as well'
    )
    parser.add_argument(
        '--method', default='least_squares', metavar='NAME',
        help='how to fit: svf, iv, huber, prediction_error, pso, ... (docs/estimation.md; '
        'default: %(default)s of the output error)',
    )  # fmt: skip
    parser.add_argument('-o', '--out', type=Path, metavar='MODEL', help='write the model (YAML)')
    add_effect_file_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Fit, print parameters and errors, write what was asked for."""
    from motor_sysid.diagnosis.fitting import fit_model
    from motor_sysid.physics.datasheet import load_datasheet
    from motor_sysid.physics.store import load_model, save_model

    load_effect_files(args.effect_file)
    sheet = load_datasheet(args.nominal) if args.nominal else None
    if args.model and args.motor:
        raise UserError('--model names the motor already; leave --motor out')
    rung = fit_model(
        load_data(args.data, args.msg_config),
        load_data(args.validate, args.msg_config),
        model=load_model(args.model) if args.model else None,
        motor=args.motor or (sheet.motor if sheet else None),
        nominal=sheet.nominal if sheet else {},
        effects=args.effect,
        method=args.method,
        validation_fraction=args.hold_back,
    )
    print('\n'.join(rung_lines(rung.model, rung.result.reason)))
    print(
        f'error: {rung.training.error_percent:.3g} % on what was fitted, '
        f'{rung.validation.error_percent:.3g} % held out'
    )
    for line in (*rung.result.unidentifiable, *rung.result.warnings):
        print(f'note: {line}')
    if args.out:
        save_model(rung.model, args.out)
        print(f'model: {args.out}')
    write_json(_document(rung), args.json)
    return 0


def rung_lines(model: 'object', reason: str) -> list[str]:
    """Return a table of the parameters."""
    from motor_sysid.physics.model import Model

    assert isinstance(model, Model)
    lines = [f'{model.kind.title}: {" + ".join(["linear", *model.effects])} ({reason})']
    for p in model.parameters:
        spread = f'± {p.sigma:.2g}' if p.sigma is not None else '(fixed)' if not p.free else ''
        lines.append(f'  {p.name:<34}{p.value:>14.6g} {spread:<12} {p.unit:<14}{p.description}')
    return lines


def _document(rung: 'object') -> dict[str, object]:
    from motor_sysid.diagnosis.document import model_parameters
    from motor_sysid.diagnosis.plain import number
    from motor_sysid.diagnosis.rung import Rung

    assert isinstance(rung, Rung)
    told = rung.result.information
    return {
        'schema': 'motor_sysid/fit/1',
        'motor': rung.model.motor,
        'effects': list(rung.model.effects),
        'success': rung.result.success,
        'reason': rung.result.reason,
        'train_error_percent': rung.training.error_percent,
        'validation_error_percent': rung.validation.error_percent,
        'channel_errors_percent': dict(rung.validation.channel_percent),
        'parameters': model_parameters(rung.model),
        'identifiability': {
            'rank': told.rank,
            'parameters': len(told.names),
            'condition': number(told.condition),
            'cramer_rao': dict(zip(told.names, map(number, told.bound), strict=True)),
        },
        'unidentifiable': list(rung.result.unidentifiable),
        'warnings': list(rung.result.warnings),
    }
