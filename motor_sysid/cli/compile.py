"""`motor-sysid compile`: compile beforehand what a node would compile at its first start."""

import argparse
import time

from motor_sysid.errors import UserError

HELP = 'compile what the nodes call, once on a machine and for a user, so that they start at once'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        '--motor', action='append', default=[], metavar='KIND',
        help='motor kind; may be given several times (default: brushed_dc)',
    )  # fmt: skip
    parser.add_argument(
        '--estimator', action='append', default=[], metavar='NAME',
        help='online estimator; may be given several times (default: rls)',
    )  # fmt: skip
    parser.add_argument(
        '--effect', action='append', default=[], metavar='KEY',
        help='effect that the model will have; may be given several times',
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Compile for each motor, and say how long it took."""
    from motor_sysid.cli.compiling import compile_nodes, compile_refits
    from motor_sysid.estimation.online.estimators import known_estimator
    from motor_sysid.physics.model import Model, SpeedSensor

    estimators = args.estimator or ['rls']
    for key in estimators:
        known_estimator(key)
    for kind in args.motor or ['brushed_dc']:
        begun = time.monotonic()
        print(f'{kind}: compiling for {", ".join(estimators)} ...', flush=True)
        model = Model.base(kind, {}, speed_sensor=SpeedSensor.DIFFERENCE)
        for key in args.effect:
            model = model.with_effect(key)
        if 'sliding_mode' in estimators and 'constant_load_torque' not in args.effect:
            raise UserError('`sliding_mode` needs the effect `constant_load_torque`; add --effect')
        compile_nodes(model, estimators, 2e-3, ())
        compile_refits(model, 2e-3)
        print(f'{kind}: ready, {time.monotonic() - begun:.1f} s')
    return 0
