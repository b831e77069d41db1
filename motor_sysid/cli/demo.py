"""Verb `demo`: the whole loop over real ROS 2, with an effect that nobody is told of."""

import argparse
from dataclasses import replace
from datetime import datetime
from pathlib import Path
import random
import signal
import sys
import time
from typing import TYPE_CHECKING

from motor_sysid.cli.common import add_json_argument, whole
from motor_sysid.cli.compiling import compile_nodes
from motor_sysid.cli.demo_motors import DemoMotor, MOTORS
from motor_sysid.cli.demo_result import Demo, finish
from motor_sysid.cli.output import writing
from motor_sysid.cli.progress import live_progress
from motor_sysid.errors import UserError
from motor_sysid.physics.store import save_model

if TYPE_CHECKING:
    from motor_sysid.nodes.launcher import NodeProcesses
    from motor_sysid.nodes.monitor import Monitor

HELP = 'run a motor with hidden effects in closed loop over ROS 2, then find out what was hidden'

LARGEST_SEED = 2**31 - 1
"""What the node `motor` takes."""
TOLERANCE = 0.1
"""The motor on the bench differs from its datasheet by up to this share."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        '--motor', choices=tuple(MOTORS), default='brushed_dc',
        help='brushed_dc on a voltage, pmsm under field-oriented control, bldc in six steps',
    )  # fmt: skip
    parser.add_argument(
        '--hide', nargs='+', action='extend', metavar='EFFECT',
        help='effects that the motor has and its model lacks (default: coulomb_friction '
        'cogging_torque)',
    )  # fmt: skip
    parser.add_argument('--seconds', type=float, default=20.0, help='duration (default 20)')
    parser.add_argument('--rate', type=float, help='samples per second (500; pmsm, bldc: 1000)')
    parser.add_argument(
        '--estimator', default='rls', help='how the identifier estimates (default: %(default)s)'
    )
    parser.add_argument('--out', type=Path, help='folder for all results (default: demo_DATE)')
    parser.add_argument('--storage', choices=('sqlite3', 'mcap'), default='sqlite3')
    parser.add_argument(
        '--seed', type=whole('--seed', 0, LARGEST_SEED), default=1,
        help='of the motor and its noise (default: %(default)s)',
    )  # fmt: skip
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Run the demo; returns the exit code."""
    begin = time.monotonic()
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # so that the nodes end in order
    motor = _chosen(args)
    out = args.out or Path(f'demo_{datetime.now().astimezone():%Y%m%d_%H%M%S}')
    if (out / 'bag').exists():
        raise UserError(f'{out} holds a bag already; give another folder with --out')
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
    nominal = motor.model()
    save_model(nominal, out / 'datasheet_model.yaml')
    print(f'Hidden in the motor: {", ".join(motor.hidden)}. The rest of the system is not told.')
    record(args, motor, out)
    print(f'Recorded {out / "bag"}; the motor is at rest. Now the diagnosis.', flush=True)
    return finish(Demo(out / 'bag', out, nominal, begin, args.json))


def _chosen(args: argparse.Namespace) -> DemoMotor:
    """Return the motor as it was asked for."""
    from motor_sysid.estimation.online.estimators import known_estimator

    motor = MOTORS[args.motor]
    rate, hidden = motor.rate if args.rate is None else args.rate, tuple(args.hide or motor.hidden)
    model = motor.model()
    for key in hidden:
        model = model.with_effect(key)
    known_estimator(args.estimator)
    if not 5 <= args.seconds <= 3600:
        raise UserError(f'--seconds {args.seconds:g} is outside 5 to 3600 s')
    if not 50 <= rate <= 1000:
        raise UserError(f'--rate {rate:g} is outside 50 to 1000 Hz')
    return replace(motor, rate=rate, hidden=hidden)


def record(args: argparse.Namespace, motor: DemoMotor, out: Path) -> None:
    """Run the four nodes through the profile and record them."""
    try:
        from motor_sysid.nodes.launcher import choose_domain, node_processes
        from motor_sysid.nodes.monitor import Monitor
    except ImportError as error:
        raise UserError(
            f'ROS 2 is missing ({error}); install the extra `ros` (make setup) or source ROS 2 '
            'Jazzy. `motor-sysid simulate` and `diagnose` work without it'
        ) from None
    print('Getting ready; compiling, once on a machine, takes a minute or two.', flush=True)
    compile_nodes(motor.model(), [args.estimator], 1 / motor.rate, motor.hidden)
    domain = choose_domain()
    print(f'Starting motor, pid, identifier and recorder (ROS_DOMAIN_ID {domain}).', flush=True)
    with node_processes(out / 'nodes') as processes:
        _start_nodes(processes, args, motor, out)
        topics = ('voltage', 'current', 'speed', f'{motor.command}_command')
        with Monitor(motor.command) as monitor:
            monitor.wait_until_heard(processes.check, [f'/motor/{topic}' for topic in topics])
            _start_motor(processes, args, motor)
            monitor.wait_until_heard(processes.check)
            monitor.start_profile(processes.check)
            _watch(monitor, processes, args.seconds)
        for name in ('pid', 'motor', 'identifier', 'recorder'):
            code = processes.stop(name)
            if code:
                raise UserError(f'node `{name}` ended with code {code}: {processes.log(name)}')


def _start_nodes(
    processes: 'NodeProcesses', args: argparse.Namespace, motor: DemoMotor, out: Path
) -> None:
    gains = motor.gains()
    bag = {'path': str(out / 'bag'), 'storage': args.storage}
    processes.start('recorder', bag, gives_way=True)
    processes.start(
        'identifier',
        {'estimator': args.estimator, 'model_file': str(out / 'datasheet_model.yaml'),
         'diagnose_window': 0.4 * args.seconds, 'diagnose_period': args.seconds},
        gives_way=True,
    )
    processes.start('pid', {
        'command': motor.command, 'kp': gains.kp, 'ki': gains.ki, 'voltage_limit': motor.supply,
        'current_limit': motor.current_limit, 'profile': 'mixed', 'top_speed': motor.top_speed,
        'profile_duration': args.seconds, 'autostart': False,
    })  # fmt: skip


def _start_motor(
    processes: 'NodeProcesses', args: argparse.Namespace, motor: DemoMotor
) -> None:
    """Start the motor, last: then every topic is recorded from its first samples on."""
    chance = random.Random(args.seed)
    truth: dict[str, float] = {
        name: value if name in motor.exact else value * (1 + TOLERANCE * chance.uniform(-1, 1))
        for name, value in motor.datasheet.items()
    }
    processes.start('motor', {
        **truth, 'motor_kind': motor.kind, 'rate': motor.rate,
        'supply_voltage': motor.supply, 'current_limit': motor.current_limit,
        'hidden_effects': list(motor.hidden), 'seed': args.seed,
    })  # fmt: skip


def _watch(monitor: 'Monitor', processes: 'NodeProcesses', seconds: float) -> None:
    """Show what happens until the profile is over."""
    patience = time.monotonic() + 3 * seconds + 30
    with live_progress(seconds, sys.stdout) as show:
        while (snapshot := monitor.look()).elapsed < seconds:
            processes.check()
            show(snapshot)
            if time.monotonic() > patience:
                raise UserError(
                    f'after {snapshot.elapsed:.1f} of {seconds:g} s nothing goes on; '
                    'the machine is too busy, or a node hangs: see the logs in nodes/'
                )
            time.sleep(0.05)
        show(snapshot)
