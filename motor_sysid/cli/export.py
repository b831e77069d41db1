"""`motor-sysid export`: write a model for other tools, and say what it leaves out."""

import argparse
from pathlib import Path
import sys

from motor_sysid.cli.common import add_effect_file_argument, add_json_argument, load_effect_files
from motor_sysid.cli.output import new_file, write_each, write_json, write_text
from motor_sysid.errors import UserError

HELP = 'write a model for other tools: feedforward, gains, MuJoCo, URDF, MATLAB, C'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    from motor_sysid.export import FORMATS, title_of

    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = '\n'.join(['formats:', *(f'  {f:12} {title_of(f)}' for f in FORMATS)])
    parser.add_argument('model', type=Path, metavar='MODEL', help='model (YAML)')
    parser.add_argument(
        '--to', required=True, choices=FORMATS, metavar='FORMAT', help='one of the list below'
    )
    parser.add_argument(
        '-o', '--out', type=new_file, metavar='FILE', help='write it there (default: stdout)'
    )
    target = parser.add_argument_group('where it goes')
    target.add_argument('--name', help='of joint and variables (default: motor)')
    for option, unit, words in (
        ('--gear', 'N', 'turns of the motor in one turn of the joint (default: 1)'),
        ('--supply', 'V', 'largest input either way; V, or N m, N, A'),
        ('--top-speed', 'SPEED', 'largest speed of the motor that matters, rad/s or m/s'),
        ('--rate', 'HZ', 'samples per second, of a controller or a model in steps'),
        ('--closed-loop-time', 'S', 'wanted time constant of the speed loop'),
        ('--body-inertia', 'J', 'inertia about the joint that a simulator adds, kg m^2'),
    ):
        target.add_argument(option, type=float, metavar=unit, help=words)
    add_effect_file_argument(parser)
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Write the model, and say what is left out."""
    from motor_sysid.export import export, Settings, uses_of
    from motor_sysid.physics.store import load_model

    names = ('name', 'gear', 'supply', 'top_speed', 'rate', 'closed_loop_time', 'body_inertia')
    uses = uses_of(args.to)
    for name in (name for name in names if name not in uses and getattr(args, name) is not None):
        options = ', '.join(f'--{one}'.replace('_', '-') for one in uses)
        raise UserError(
            f'--{name.replace("_", "-")} does nothing with --to {args.to}, which takes {options}; '
            'leave it out'
        )
    load_effect_files(args.effect_file)
    given = {name: value for name in names if (value := getattr(args, name)) is not None}
    made = export(load_model(args.model), args.to, Settings(**given))
    if args.out is None and args.json is not sys.stdout:
        print(made.text, end='')
    for note in made.left_out:
        print(f'  not in it: {note}', file=sys.stderr)
    document = {
        'schema': 'motor_sysid/export/1', 'format': args.to, 'text': made.text,
        'left_out': list(made.left_out),
    }  # fmt: skip
    write_each(
        lambda: write_text(made.text, args.out, args.to) if args.out else None,
        lambda: write_json(document, args.json),
    )
    return 0
