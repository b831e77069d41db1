"""Which long work is wanted, and which is done: one job of each kind may wait for the worker."""

from collections.abc import Callable, Sequence

from motor_sysid.nodes.worker import Done, Job, Worker

Make = Callable[[], Job | None]
"""Makes a job of the samples at hand when the worker is free; None if there are too few."""


class Jobs:
    """A queue in front of the worker.

    Parameters
    ----------
    effect_files:
        The user's own effects; see `Worker`.

    Attributes
    ----------
    running:
        Kind of the job that is being worked on; empty if there is none.
    """

    def __init__(self, effect_files: Sequence[str] = ()) -> None:
        self._worker = Worker(effect_files)
        self._waiting: dict[str, Make] = {}
        self.running = ''

    def start(self) -> None:
        """Start the worker's process before there is a job."""
        self._worker.start()

    def ask(self, kind: str, make: Make) -> bool:
        """Ask for a job; False if one of this kind runs or waits already."""
        if kind == self.running or kind in self._waiting:
            return False
        self._waiting[kind] = make
        return True

    def poll(self) -> Done | None:
        """Return what was done, and give the worker the next job; must be called often."""
        done = self._worker.poll()
        if done is not None:
            self.running = ''
        while self._waiting and not self._worker.busy:
            kind = next(iter(self._waiting))
            job = self._waiting.pop(kind)()
            if job is not None and self._worker.submit(job):
                self.running = kind
        return done

    def close(self) -> None:
        """End the worker."""
        self._worker.close()
