"""Make the estimator of a new configuration beside the running one."""

from collections.abc import Callable
import threading
import traceback

from motor_sysid.errors import UserError
from motor_sysid.estimation.online import OnlineIdentifier
from motor_sysid.nodes.configuration import Configuration


class Preparation:
    """An estimator in the making, in a thread: the first one of its kind has to be compiled.

    Parameters
    ----------
    build:
        Returns the configuration; called in the thread.
    sample_time:
        What the estimator is made for, s; 0 if it is not known yet.
    """

    def __init__(self, build: Callable[[], Configuration], sample_time: float) -> None:
        self._build, self._sample_time = build, sample_time
        self._ready: OnlineIdentifier | None = None
        self._configuration: Configuration | None = None
        self._problem: UserError | None = None
        self._thread = threading.Thread(target=self._prepare, daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether it is not done yet."""
        return self._thread.is_alive()

    def _prepare(self) -> None:
        try:
            made = self._build()
            made.warm_up()
            if self._sample_time:
                self._ready = made.make(self._sample_time)
            self._configuration = made
        except UserError as problem:
            self._problem = problem
        except Exception as problem:  # noqa: BLE001 - the node goes on with what it has
            traceback.print_exc()
            self._problem = UserError(f'no estimator can be made: {_in_a_line(problem)}')

    def configuration(self) -> Configuration:
        """Return the configuration, once it is done.

        Raises
        ------
        UserError
            If there can be no such estimator.
        """
        self._thread.join()
        if self._problem is not None:
            raise self._problem
        assert self._configuration is not None
        return self._configuration

    def make(self, sample_time: float) -> OnlineIdentifier:
        """Return the estimator that was made, once; then fresh ones."""
        ready, self._ready = self._ready, None
        if ready is not None and sample_time == self._sample_time:
            return ready
        return self.configuration().make(sample_time)


def _in_a_line(problem: Exception) -> str:
    """Return what was raised: of a compiler's report, the last line before the first blank one."""
    lines = str(problem).split('\n\n')[0].splitlines() or ['']
    return f'{type(problem).__name__}: {lines[-1]}'
