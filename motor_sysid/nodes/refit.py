"""Refits in one worker process, so that the node keeps up with its topics meanwhile."""

from dataclasses import dataclass
import multiprocessing
from multiprocessing.connection import Connection
import os
import signal
import threading
import time

from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

NICENESS = 10
"""The worker gives way to the nodes."""


@dataclass(frozen=True)
class RefitJob:
    """What to fit: a model on a record, by which method, from which seed."""

    model: Model
    record: Record
    method: str
    seed: int


@dataclass(frozen=True)
class RefitOutcome:
    """What came of it.

    Attributes
    ----------
    model:
        The fitted model with sigmas; None where the fit could not be made.
    success, reason:
        Whether it converged, and how it ended.
    noise:
        Output to RMS of what the fit leaves.
    seconds:
        Time taken.
    """

    model: Model | None
    success: bool
    reason: str
    noise: dict[str, float]
    seconds: float


class RefitWorker:
    """One process that works on one job at a time.

    Sending a job may have to wait until the process has started, so a thread does it.
    """

    def __init__(self) -> None:
        self._process: multiprocessing.process.BaseProcess | None = None
        self._thread: threading.Thread | None = None
        self._outcome: RefitOutcome | None = None

    @property
    def busy(self) -> bool:
        """Whether a job is being worked on, or its outcome waits to be taken."""
        return self._thread is not None

    def start(self) -> None:
        """Start the process, if it does not run; its imports then do not delay the first job."""
        if self._process is not None and self._process.is_alive():
            return
        context = multiprocessing.get_context('spawn')
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()

    def submit(self, job: RefitJob) -> bool:
        """Give a job; False if the worker is busy."""
        if self.busy:
            return False
        self.start()
        self._outcome = None
        self._thread = threading.Thread(target=self._exchange, args=(job,), daemon=True)
        self._thread.start()
        return True

    def poll(self) -> RefitOutcome | None:
        """Return the outcome once, when it is there."""
        if self._outcome is None or self._thread is None:
            return None
        self._thread.join()
        self._thread = None
        return self._outcome

    def close(self) -> None:
        """End the process, whatever it is doing."""
        if self._process is not None:
            self._process.kill()
            self._process.join(2.0)

    def _exchange(self, job: RefitJob) -> None:
        try:
            self._connection.send(job)
            outcome = self._connection.recv()
        except (EOFError, OSError):
            outcome = RefitOutcome(None, False, 'the worker process ended', {}, 0.0)
        self._outcome = outcome


def _serve(connection: Connection) -> None:
    """Work on jobs until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(NICENESS)
    while True:
        try:
            job: RefitJob = connection.recv()
            connection.send(_fit(job))
        except (EOFError, OSError):
            return


def _fit(job: RefitJob) -> RefitOutcome:
    from motor_sysid.estimation.batch import refit

    begin = time.perf_counter()
    try:
        result = refit(job.model, job.record, method=job.method, seed=job.seed)
    except UserError as error:
        return RefitOutcome(None, False, str(error), {}, time.perf_counter() - begin)
    seconds = time.perf_counter() - begin
    return RefitOutcome(result.model, result.success, result.reason, dict(result.noise), seconds)
