"""Worker processes with a time limit for each task: one that hangs or crashes costs one task."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
import signal
import time
from typing import Generic, TypeVar

from motor_sysid.threads import use_one

Task = TypeVar('Task')
Answer = TypeVar('Answer')

_START = 120.0
"""Time that a worker may take to import everything, s."""


@dataclass(frozen=True)
class Lost:
    """Why a task has no answer: the worker crashed or was stopped at the time limit."""

    reason: str
    seconds: float


@dataclass
class _Worker(Generic[Task]):
    process: BaseProcess
    connection: Connection
    task: Task | None = None
    begun: float = 0.0
    ready: bool = False


def each(
    tasks: Iterable[Task],
    work: Callable[[Task], Answer],
    *,
    workers: int,
    limit: float,
    warm_up: Callable[[], None] | None = None,
) -> Iterator[tuple[Task, Answer | Lost]]:
    """Yield every task with its answer as they come.

    Parameters
    ----------
    tasks:
        What to do; picklable.
    work:
        A function of a module that does one; what it raises ends its worker.
    workers:
        Processes.
    limit:
        Longest time for one task, s.
    warm_up:
        Called once in each worker before its first task, outside the time limit.
    """
    use_one()  # in the processes that are started below
    left = deque(tasks)
    team: list[_Worker[Task]] = []
    try:
        while left or team:
            while left and len(team) < workers and len(team) < len(left) + _busy(team):
                team.append(_start(work, warm_up))
            for worker in _heard(team, limit):
                done = _answer(worker, limit)
                if done is not None:
                    assert worker.task is not None
                    yield worker.task, done
                    worker.task = None
                if isinstance(done, Lost) or not _give(worker, left):
                    _stop(worker)
                    team.remove(worker)
    finally:
        for worker in team:
            _stop(worker)


def _busy(team: list[_Worker[Task]]) -> int:
    return sum(worker.task is not None for worker in team)


def _start(work: Callable[[Task], Answer], warm_up: Callable[[], None] | None) -> _Worker[Task]:
    context = get_context('spawn')
    mine, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, work, warm_up), daemon=True)
    process.start()
    theirs.close()
    return _Worker(process, mine, begun=time.monotonic())


def _serve(
    connection: Connection, work: Callable[[Task], Answer], warm_up: Callable[[], None] | None
) -> None:
    """Do tasks until there are no more; the body of a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent is interrupted, and ends us
    if warm_up:
        warm_up()
    said: tuple[Answer] | None = None
    while True:
        try:
            connection.send(said)
            task = connection.recv()
        except (EOFError, BrokenPipeError):  # there are no more, or whoever asked has died
            return
        said = (work(task),)


def _heard(team: list[_Worker[Task]], limit: float) -> list[_Worker[Task]]:
    """Wait for workers that have something to say or are out of time."""
    now = time.monotonic()
    next_end = min(_end(worker, limit) for worker in team)
    said = wait([w.connection for w in team], timeout=max(next_end - now, 0.0))
    now = time.monotonic()
    return [w for w in team if w.connection in said or _end(w, limit) <= now]


def _end(worker: _Worker[Task], limit: float) -> float:
    return worker.begun + (limit if worker.ready else _START)


def _answer(worker: _Worker[Task], limit: float) -> 'Answer | Lost | None':
    """Return what a worker that was heard has to say; None if it is only ready for work."""
    seconds = time.monotonic() - worker.begun
    if not worker.connection.poll():
        return _lost(worker, f'stopped after {limit:g} s', seconds)
    try:
        said = worker.connection.recv()
    except EOFError:
        return _lost(worker, 'its process died', seconds)
    worker.ready = True
    return None if said is None else said[0]


def _lost(worker: _Worker[Task], reason: str, seconds: float) -> Lost:
    if worker.task is None:
        raise RuntimeError(f'a worker process did not start: {reason}')
    return Lost(reason, seconds)


def _give(worker: _Worker[Task], left: 'deque[Task]') -> bool:
    if not left:
        return False
    worker.task, worker.begun = left.popleft(), time.monotonic()
    worker.connection.send(worker.task)
    return True


def _stop(worker: _Worker[Task]) -> None:
    worker.connection.close()
    worker.process.kill()
    worker.process.join()
