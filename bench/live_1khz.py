"""A minute at 1 kHz with refits running: what is lost, how long callbacks take, what it costs.

    .venv/bin/python bench/live_1khz.py --seconds 60 --estimator rls --json live.json

Starts motor, pid, identifier and recorder as processes of their own over real DDS.  Nothing is
assumed about the machine: figures from a busy one are worse, and say so by its load.
"""

import argparse
from collections.abc import Iterator
import json
import os
from pathlib import Path
import sys
import tempfile
import time

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from motor_sysid.nodes.launcher import choose_domain, node_processes, NodeProcesses
from motor_sysid.nodes.monitor import Monitor
from motor_sysid.nodes.replay import replay
from motor_sysid.recording.field_reader import FieldReader
from motor_sysid.recording.rosbag import Bag

NODES = ('motor', 'pid', 'identifier', 'recorder')
SHOWN = (
    'lost', 'intake', 'batch', 'refits', 'missing', 'gaps', 'early', 'incomplete', 'over',
    'backlog',
)  # fmt: skip
TICKS = os.sysconf('SC_CLK_TCK')
STAMP = ('header.stamp.sec', 'header.stamp.nanosec')


def main() -> None:
    """Run the benchmark and print its figures."""
    args = arguments()
    choose_domain()
    with tempfile.TemporaryDirectory() as folder:
        result = measure(args, Path(folder))
    print(json.dumps(result, indent=1))  # noqa: T201
    if args.json:
        args.json.write_text(json.dumps(result, indent=1) + '\n')


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=60.0)
    parser.add_argument('--rate', type=float, default=1000.0)
    parser.add_argument('--estimator', default='rls')
    parser.add_argument('--refit-period', type=float, default=5.0)
    parser.add_argument('--refit-method', default='pso')
    parser.add_argument('--drain-period', type=float, default=0.002)
    parser.add_argument('--storage', default='sqlite3')
    parser.add_argument(
        '--realtime', type=int, default=0,
        help='run the identifier under SCHED_FIFO with this priority, as `chrt -f N` does',
    )
    parser.add_argument('--json', type=Path)
    return parser.parse_args()


def measure(args: argparse.Namespace, folder: Path) -> dict[str, object]:
    """Run the loop and collect the figures."""
    bag = folder / 'bag'
    with node_processes(folder / 'nodes') as processes:
        start(processes, args, bag)
        if args.realtime:
            identifier = processes.process_id('identifier')
            os.sched_setscheduler(identifier, os.SCHED_FIFO, os.sched_param(args.realtime))
        with Monitor() as monitor:
            monitor.wait_until_heard(processes.check)
            monitor.start_profile(processes.check)
            begin, cpu = time.monotonic(), cpu_seconds(processes)
            while monitor.look().elapsed < args.seconds:
                processes.check()
                time.sleep(0.2)
            passed = time.monotonic() - begin
            share = {n: (cpu_seconds(processes)[n] - cpu[n]) / passed for n in NODES}
        for name in NODES:
            assert processes.stop(name) == 0, name
    health = last_status(bag, 'identifier: intake')
    return {
        'settings': {k: v for k, v in vars(args).items() if k != 'json'},
        'load_average': os.getloadavg()[0],
        'wall_seconds': round(passed, 2),
        'cpu_share': {name: round(value, 3) for name, value in share.items()},
        'identifier': {
            key: value for key, value in health.items()
            if key.startswith(SHOWN)
        },
        'recorder': last_status(bag, 'recorder'),
        'recorded_grid': {topic: grid(bag, topic) for topic in (
            '/motor/voltage', '/motor/current', '/motor/speed')},
        'replay': check(bag),
    }  # fmt: skip


def start(processes: NodeProcesses, args: argparse.Namespace, bag: Path) -> None:
    """Start the four nodes."""
    processes.start('recorder', {'path': str(bag), 'storage': args.storage})
    processes.start('identifier', {
        'estimator': args.estimator, 'refit_period': args.refit_period, 'refit_window': 5.0,
        'refit_method': args.refit_method, 'drain_period': args.drain_period,
    })  # fmt: skip
    processes.start('motor', {'rate': args.rate, 'hidden_effects': ['coulomb_friction']})
    processes.start('pid', {
        'profile': 'mixed', 'profile_duration': args.seconds, 'autostart': False,
    })  # fmt: skip


def cpu_seconds(processes: NodeProcesses) -> dict[str, float]:
    """Return user plus system time of each node, without its refit worker."""
    seconds = {}
    for name in NODES:
        text = Path(f'/proc/{processes.process_id(name)}/stat').read_text()
        fields = text.rpartition(')')[2].split()
        seconds[name] = (int(fields[11]) + int(fields[12])) / TICKS
    return seconds


def statuses(bag: Path, wanted: str) -> Iterator[dict[str, str]]:
    """Yield the values of every status of that name on /diagnostics."""
    from rosbags.typesys import get_typestore, Stores

    store = get_typestore(Stores.ROS2_JAZZY)
    for _, _, data in Bag(bag).iterate(['/diagnostics']):
        for status in store.deserialize_cdr(data, 'diagnostic_msgs/msg/DiagnosticArray').status:
            if status.name == wanted:
                yield {pair.key: pair.value for pair in status.values}


def last_status(bag: Path, wanted: str) -> dict[str, float]:
    """Return the last status of that name, as numbers."""
    found = list(statuses(bag, wanted))
    return {key: round(float(value), 4) for key, value in found[-1].items()} if found else {}


def grid(bag: Path, topic: str) -> dict[str, int]:
    """Count the messages of a topic and the stamps that are missing among them."""
    kind = Bag(bag).topics[topic].msgtype
    read = FieldReader(kind, STAMP).read
    pairs = [read(data) for data in Bag(bag).read([topic])[topic]]
    stamps = np.array([int(s) * 10**9 + int(n) for s, n in pairs])
    steps = np.diff(stamps)
    missing = np.rint(steps / np.median(steps)) - 1
    return {'messages': stamps.size, 'missing': int(missing.sum())}


def check(bag: Path) -> dict[str, object]:
    """Replay the bag and compare with what was published live."""
    result = replay(bag)
    found = result.check
    assert found is not None
    return {
        'samples': result.samples,
        'times_real_time': round(result.duration / result.seconds, 1),
        'compared': found.compared,
        'unreachable': found.unreachable,
        'equal': found.equal,
        'difference': found.difference,
    }


if __name__ == '__main__':
    main()
