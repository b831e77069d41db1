"""Long work in one process of its own, so that the node keeps up with its topics meanwhile."""

from collections.abc import Sequence
from dataclasses import dataclass
import multiprocessing
from multiprocessing.connection import Connection
import os
import signal
import threading
import time
import traceback
from typing import Protocol

from motor_sysid.errors import UserError
from motor_sysid.nodes.own_effects import add_effect_files

NICENESS = 10
"""The worker gives way to the nodes."""


class Job(Protocol):
    """What the worker can do; it is sent to the process, and what it returns is sent back."""

    def work(self) -> object:
        """Do it and return the outcome; a `UserError` says that the data do not allow it."""


@dataclass(frozen=True)
class Failed:
    """A job that came to nothing.

    Attributes
    ----------
    reason:
        Why, in words.
    """

    reason: str


@dataclass(frozen=True)
class Done:
    """A job and what came of it: `outcome` is `Failed` or what its `work` returned."""

    job: Job
    outcome: object
    seconds: float


class Worker:
    """One process that works on one job at a time.

    Sending a job may have to wait until the process has started, so a thread does it.

    Parameters
    ----------
    effect_files:
        The user's own effects, which are added to the catalogue of that process, too.
    """

    def __init__(self, effect_files: Sequence[str] = ()) -> None:
        self._effect_files = tuple(effect_files)
        self._process: multiprocessing.process.BaseProcess | None = None
        self._thread: threading.Thread | None = None
        self._done: Done | None = None
        self.job: Job | None = None

    @property
    def busy(self) -> bool:
        """Whether a job is being worked on, or its outcome waits to be taken."""
        return self.job is not None

    def start(self) -> None:
        """Start the process, if it does not run; its imports then do not delay the first job."""
        if self._process is not None and self._process.is_alive():
            return
        context = multiprocessing.get_context('spawn')
        self._connection, theirs = context.Pipe()
        self._process = context.Process(
            target=_serve, args=(theirs, self._effect_files), daemon=True
        )
        self._process.start()
        theirs.close()

    def submit(self, job: Job) -> bool:
        """Give a job; False if the worker is busy."""
        if self.busy:
            return False
        self.start()
        self._done, self.job = None, job
        self._thread = threading.Thread(target=self._exchange, args=(job,), daemon=True)
        self._thread.start()
        return True

    def poll(self) -> Done | None:
        """Return what came of the job once, when it is there."""
        done = self._done
        if done is None or self._thread is None:
            return None
        self._thread.join()
        self._thread = self._done = self.job = None
        return done

    def close(self) -> None:
        """End the process, whatever it is doing."""
        if self._process is not None:
            self._process.kill()
            self._process.join(2.0)

    def _exchange(self, job: Job) -> None:
        begin = time.perf_counter()
        try:
            self._connection.send(job)
            outcome: object = self._connection.recv()
        except (EOFError, OSError):
            self.close()
            outcome = Failed('the worker process ended')
        self._done = Done(job, outcome, time.perf_counter() - begin)


def _serve(connection: Connection, effect_files: Sequence[str]) -> None:
    """Work on jobs until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _give_way()
    add_effect_files(effect_files)
    while True:
        try:
            job: Job = connection.recv()
            connection.send(_outcome(job))
        except (EOFError, OSError):
            return


def _give_way() -> None:
    """Leave the real-time class that the node may have been started in, and be nice."""
    if hasattr(os, 'sched_setscheduler'):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.nice(NICENESS)


def _outcome(job: Job) -> object:
    try:
        return job.work()
    except UserError as error:
        return Failed(str(error))
    except Exception as error:  # noqa: BLE001 - the next job shall find the worker alive
        traceback.print_exc()
        return Failed(f'{type(error).__name__}: {error}')
