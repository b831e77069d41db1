"""How much a computation may take, in steps of the integration: the same on every machine.

A limit in seconds would give another answer on a slower or a busier one.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
import math
from threading import Lock

_NOW: ContextVar['Effort | None'] = ContextVar('effort', default=None)


class Effort:
    """Steps that a motor's integration has taken, summed over all parameter vectors.

    One that is made while another counts adds to that as well.

    Attributes
    ----------
    limit:
        How many a computation may take before it is asked to come to an end.
    steps:
        How many it has taken.
    cut:
        Whether it was told that they are spent.
    """

    def __init__(self, limit: float = math.inf) -> None:
        self.limit, self.steps, self.cut = limit, 0, False
        self._lock, self._outer = Lock(), _NOW.get()

    def add(self, steps: int) -> None:
        """Count steps; may be called in any thread."""
        with self._lock:
            self.steps += steps
        if self._outer is not None:
            self._outer.add(steps)

    def is_spent(self) -> bool:
        """Whether the limit is reached; what comes after it is left out then, which is noted."""
        spent = self.steps > self.limit
        self.cut = self.cut or spent
        return spent


@contextmanager
def counted_by(effort: Effort | None) -> Iterator[None]:
    """Let `effort` count the steps that are taken inside; None counts nothing."""
    token = _NOW.set(effort)
    try:
        yield
    finally:
        _NOW.reset(token)


def current() -> Effort | None:
    """Return what counts steps here, for a thread that is to go on with it."""
    return _NOW.get()


def count(steps: int) -> None:
    """Count steps of the integration, where somebody wants to know."""
    effort = _NOW.get()
    if effort is not None:
        effort.add(steps)


def is_spent() -> bool:
    """Whether a limit is set here and reached."""
    effort = _NOW.get()
    return effort is not None and effort.is_spent()
