"""Verb `record`: topics into a rosbag2 bag that survives a kill; the `recorder` node."""

import argparse
from pathlib import Path
import tempfile

import yaml

from motor_sysid.errors import UserError

HELP = 'record topics into a bag until Ctrl-C'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        'topics', nargs='*', metavar='TOPIC',
        help='default: the topics of the motor, the controller and the identifier',
    )  # fmt: skip
    parser.add_argument('--all', action='store_true', help='every topic there is')
    parser.add_argument('--out', type=Path, help='folder of the new bag (default: bag_DATE)')
    parser.add_argument('--storage', choices=('sqlite3', 'mcap'), default='sqlite3')


def run(args: argparse.Namespace) -> int:
    """Record until told to stop; returns the exit code."""
    try:
        from motor_sysid.nodes.recorder import main
    except ImportError as error:
        raise UserError(
            f'ROS 2 is missing ({error}); install the extra `ros` (make setup) or source ROS 2'
        ) from None
    settings: dict[str, object] = {'storage': args.storage, 'all_topics': args.all}
    if args.topics:
        settings['topics'] = args.topics
    if args.out:
        settings['path'] = str(args.out)
    with tempfile.NamedTemporaryFile('w', suffix='.yaml') as file:
        yaml.safe_dump({'/**': {'ros__parameters': settings}}, file)
        file.flush()
        return main(['recorder', '--ros-args', '--params-file', file.name])
