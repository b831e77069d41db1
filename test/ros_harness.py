"""Run nodes in this process or in others, and wait for what they do, never for a time."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time
from typing import IO

PATIENCE = 120.0
"""Seconds after which a test gives up; a busy machine needs ten times what an idle one does."""


def wait_for(condition: Callable[[], object], what: str, patience: float = PATIENCE) -> None:
    """Poll until the condition holds."""
    end = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < end, f'{what} did not come within {patience:g} s'
        time.sleep(0.01)


class NodeProcess:
    """A node in a process of its own."""

    def __init__(self, name: str, arguments: Sequence[str] = ()) -> None:
        self.name = name
        self._log: IO[str] = tempfile.TemporaryFile('w+')  # noqa: SIM115 - closed in kill()
        self.process = subprocess.Popen(
            [sys.executable, '-m', f'motor_sysid.nodes.{name}', '--ros-args', *arguments],
            stdout=self._log, stderr=subprocess.STDOUT, text=True,
            cwd=Path(__file__).resolve().parent.parent,
        )  # fmt: skip

    def output(self) -> str:
        """Return what it has printed so far."""
        self._log.seek(0)
        return self._log.read()

    def wait_until_ready(self) -> None:
        """Wait for the line that a node logs when it is ready."""
        wait_for(lambda: '[INFO]' in self.output() or self.process.poll() is not None, self.name)
        assert self.process.poll() is None, self.output()

    def end(self, *signals: signal.Signals) -> int:
        """Send signals one right after the other and return the exit code."""
        for number in signals or (signal.SIGINT,):
            with suppress(ProcessLookupError):
                os.kill(self.process.pid, number)
        return self.process.wait(PATIENCE)

    def kill(self) -> None:
        """End it whatever it does."""
        self.process.kill()
        self.process.wait(PATIENCE)
        self._log.close()


@contextmanager
def nodes(**arguments: Sequence[str]) -> Iterator[dict[str, NodeProcess]]:
    """Run nodes by name, each with its ROS arguments; they are ready on entry."""
    running = {name: NodeProcess(name, given) for name, given in arguments.items()}
    try:
        for node in running.values():
            node.wait_until_ready()
        yield running
    finally:
        for node in running.values():
            node.kill()


def parameters(**values: object) -> list[str]:
    """Return ``-p name:=value`` for each."""
    return [text for name, value in values.items() for text in ('-p', f'{name}:={value}')]
