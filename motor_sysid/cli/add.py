"""`motor-sysid add`: add an effect to a model, refit, and see the error fall."""

import argparse
from pathlib import Path

from motor_sysid.cli.common import (
    add_data_arguments,
    add_effect_file_argument,
    load_effect_files,
    progress,
)
from motor_sysid.cli.output import new_file, write_each, write_json, write_model
from motor_sysid.cli.reading import load_first_model, load_parts
from motor_sysid.errors import UserError

HELP = 'add an effect to a model, refit on recordings, and say what it brings'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument('model', type=Path, metavar='MODEL', help='model (YAML)')
    parser.add_argument('effect', metavar='EFFECT', help='key of the effect to add')
    add_data_arguments(parser, validate=True)
    parser.add_argument(
        '-o', '--out', type=new_file, metavar='MODEL', help='write the new model (YAML)'
    )
    add_effect_file_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Add, refit, print before and after."""
    from motor_sysid.cli.fit import rung_lines
    from motor_sysid.diagnosis.fitting import add_effect
    from motor_sysid.diagnosis.result.document import model_parameters
    from motor_sysid.physics.effects import effect

    load_effect_files(args.effect_file, [args.effect])
    model = load_first_model(args)
    train, held = load_parts(args)
    before, trial = add_effect(
        model,
        args.effect,
        train,
        held,
        validation_fraction=args.hold_back,
        progress=progress(),
    )
    after = trial.rung
    if args.effect not in after.model.effects:
        raise UserError(
            f'{effect(args.effect).card.title} cannot be fitted to these data: {trial.note}; '
            'nothing is written'
        )
    print('\n'.join(rung_lines(after.model, after.result.reason)))
    print(
        f'held-out error {before.validation.error_percent:.4g} -> '
        f'{after.validation.error_percent:.4g} %, evidence dBIC {trial.delta_bic:.4g}: '
        f'{trial.note or "it helps"}'
    )
    document = {
        'schema': 'motor_sysid/add/1',
        'effect': args.effect,
        'delta_bic': trial.delta_bic,
        'passes': trial.passes,
        'note': trial.note,
        'validation_error_percent': [
            before.validation.error_percent, after.validation.error_percent,
        ],
        'train_error_percent': [before.training.error_percent, after.training.error_percent],
        'parameters': model_parameters(after.model),
    }  # fmt: skip
    write_each(lambda: write_model(after.model, args.out), lambda: write_json(document, args.json))
    return 0
