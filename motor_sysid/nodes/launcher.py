"""Start nodes as processes of their own, watch them, and end them in order."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
import ctypes
from functools import partial
import os
from pathlib import Path
import signal
import socket
import subprocess
import sys

import yaml

from motor_sysid.errors import UserError

SHOWN = 12
"""Lines of a log that are shown when its node died."""

PARTING = 15.0
"""Seconds that a node has to close before it is killed."""

PARTICIPANTS = 32
"""Participants of a domain whose ports are looked at."""

GIVING = 5
"""Niceness of a node that gives way to others."""

PR_SET_PDEATHSIG = 1

Value = bool | int | float | str | Sequence[str]


class NodeProcesses:
    """Nodes of this package, each in a process of its own, with its log in a file.

    They are in a session of their own: Ctrl-C reaches only the process that started them, which
    ends them one after the other; and they end when it dies.

    Parameters
    ----------
    folder:
        Where parameter files and logs go.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        folder.mkdir(parents=True, exist_ok=True)

    def start(
        self, name: str, parameters: Mapping[str, Value], *, gives_way: bool = False
    ) -> None:
        """Start the node ``motor_sysid.nodes.<name>`` with its parameters.

        One that `gives_way` need not be on time: where there is too little of the processor for
        all, the others get it.
        """
        settings = self._folder / f'{name}.yaml'
        tree = {'/**': {'ros__parameters': dict(parameters)}}
        settings.write_text(yaml.safe_dump(tree), encoding='utf8')
        command = [
            sys.executable, '-m', f'motor_sysid.nodes.{name}',
            '--ros-args', '--params-file', str(settings),
        ]  # fmt: skip
        with self.log(name).open('wb') as log:
            self._running[name] = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                start_new_session=True, preexec_fn=partial(_begin, GIVING if gives_way else 0),
            )  # fmt: skip

    def process_id(self, name: str) -> int:
        """Return the process id of a running node."""
        return self._running[name].pid

    def log(self, name: str) -> Path:
        """Return the log file of a node."""
        return self._folder / f'{name}.log'

    def check(self) -> None:
        """Refuse to go on if a node has ended.

        Raises
        ------
        UserError
            With its name, its exit code and the last lines of its log.
        """
        for name, process in self._running.items():
            code = process.poll()
            if code is not None:
                lines = self.log(name).read_text(errors='replace').splitlines()[-SHOWN:]
                tail = '\n  '.join(lines) or '(no output)'
                raise UserError(
                    f'node `{name}` ended with code {code}; its last lines '
                    f'({self.log(name)}):\n  {tail}'
                )

    def stop(self, name: str) -> int:
        """End a node as Ctrl-C would and return its exit code; kill it if it does not obey."""
        process = self._running.pop(name)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            with suppress(ProcessLookupError):
                process.send_signal(number)
            with suppress(subprocess.TimeoutExpired):
                return process.wait(PARTING)
        raise UserError(f'node `{name}` (process {process.pid}) does not end')

    def stop_all(self) -> None:
        """End the nodes that still run, what drives first: it leaves the motor at 0 V."""
        for name in sorted(self._running, key=_parting_order):
            self.stop(name)


@contextmanager
def node_processes(folder: Path) -> Iterator[NodeProcesses]:
    """Start nodes inside the block; all of them have ended after it, whatever happens."""
    processes = NodeProcesses(folder)
    try:
        yield processes
    finally:
        processes.stop_all()


def _parting_order(name: str) -> int:
    order = ('excitation', 'pid', 'motor', 'identifier', 'recorder')
    return order.index(name) if name in order else len(order)


_PRCTL = getattr(ctypes.CDLL(None), 'prctl', None)


def _begin(niceness: int) -> None:
    """Have the kernel send SIGTERM when the parent dies (Linux), and be nice."""
    if _PRCTL is not None:
        _PRCTL(PR_SET_PDEATHSIG, signal.SIGTERM)
    os.nice(niceness)


def choose_domain() -> int:
    """Keep this run apart from other ROS systems on the machine and the network.

    Takes a domain that nobody on this machine is in, and stays on it, unless the user has set
    ROS_DOMAIN_ID or ROS_AUTOMATIC_DISCOVERY_RANGE; returns the domain.
    """
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    if not os.environ.get('ROS_DOMAIN_ID'):
        start = os.getpid()
        domains = [1 + (start + k) % 101 for k in range(101)]
        os.environ['ROS_DOMAIN_ID'] = str(next(filter(_is_free, domains), domains[0]))
    return int(os.environ['ROS_DOMAIN_ID'])


def _is_free(domain: int) -> bool:
    """Tell whether the ports of all participants of a domain (DDSI-RTPS 2.5, 9.6.2) are free.

    Of nodes that have outlived the one that was first, the first port alone tells nothing.
    """
    first = 7410 + 250 * domain
    return all(_is_unbound(first + 2 * number) for number in range(PARTICIPANTS))


def _is_unbound(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', port))
        except OSError:
            return False
        return True
