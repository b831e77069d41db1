"""Join the messages of several topics on equal stamps, whatever the order of their arrival."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

Values = tuple[float, ...]
Row = tuple[int, Values]
"""Stamp in ns and the values of all topics, in the order of the topics."""

RESTART = 1_000_000_000
"""A stamp that falls back by more than this (ns) means that the source started anew."""


@dataclass
class JoinCounts:
    """What became of the messages.

    Attributes
    ----------
    joined:
        Samples that were complete.
    incomplete:
        Messages dropped because a partner with the same stamp never came.
    out_of_order:
        Messages dropped because their stamp was not after the one before on the same topic.
    overflow:
        Messages dropped because another topic was silent for too long.
    early:
        Messages from before every topic was heard: a subscription begins when it is matched, each
        topic at its own time.  They are no loss.
    restarts:
        How often the stamps jumped back.
    """

    joined: int = 0
    incomplete: int = 0
    out_of_order: int = 0
    overflow: int = 0
    early: int = 0
    restarts: int = 0

    @property
    def dropped(self) -> int:
        """Messages that did not become part of a sample, since all topics are heard."""
        return self.incomplete + self.out_of_order + self.overflow


LIMIT = 4096
"""Most messages that wait on one topic."""
REMEMBERED, KNOWN = 32, 4
"""Intervals of a topic whose mean is its period, and how many there must be."""


class StampJoin:
    """Merges ordered topics.

    Every topic is in order by itself, so a message whose stamp is older than the first waiting
    message of another topic can have no partner there any more and is dropped at once.  The result
    depends on the messages alone, not on how their arrivals interleave: a replay joins the same
    samples as the live node did.  Only a topic that falls silent makes the others wait, at most
    for `limit` messages.

    Samples begin where every topic has been heard; after a restart they begin anew.

    With a tolerance the nearest stamps go together: one that is further than half a period of its
    topic from the newest has a successor that is nearer, or will have.

    Parameters
    ----------
    topics:
        How many there are.
    limit:
        Most messages that wait on one topic.
    tolerance:
        Largest difference of stamps (ns) that still counts as equal; a sample bears the newest.
    counts:
        Told what becomes of the messages.
    """

    def __init__(
        self, topics: int, limit: int = LIMIT, tolerance: int = 0,
        counts: JoinCounts | None = None,
    ) -> None:  # fmt: skip
        self.counts = counts or JoinCounts()
        self._waiting: tuple[deque[Row], ...] = tuple(deque() for _ in range(topics))
        self._last = [-(2**63)] * topics
        self._done: list[Row] = []
        self._begin: int | None = None
        self._limit, self._tolerance = limit, tolerance
        self._taken: tuple[deque[int], ...] = tuple(
            deque(maxlen=REMEMBERED + 1) for _ in range(topics)
        )

    def push(self, topic: int, stamp: int, values: Values) -> None:
        """Take one message: its stamp in ns and its values."""
        if stamp <= self._last[topic]:
            if stamp > self._last[topic] - RESTART:
                self.counts.out_of_order += 1
                return
            self._restart()
        self._last[topic] = stamp
        queue = self._waiting[topic]
        if len(queue) >= self._limit:
            queue.popleft()
            if self._begin is None:
                self.counts.early += 1
            else:
                self.counts.overflow += 1
        queue.append((stamp, values))

    def pop(self) -> list[Row]:
        """Return the samples that are complete, in order."""
        rows, self._done = [*self._done, *self._complete()], []
        return rows

    def _complete(self) -> list[Row]:
        rows: list[Row] = []
        waiting = self._waiting
        while all(waiting):
            stamps = [queue[0][0] for queue in waiting]
            newest = max(stamps)
            if self._begin is None:
                self._begin = newest - self._tolerance
            if all(newest - stamp <= self._reach(k) for k, stamp in enumerate(stamps)):
                rows.append((newest, _flat([self._take(k)[1] for k in range(len(waiting))])))
            else:
                self._drop_before(newest)
        self.counts.joined += len(rows)
        return rows

    def _take(self, topic: int) -> Row:
        row = self._waiting[topic].popleft()
        self._taken[topic].append(row[0])
        return row

    def _reach(self, topic: int) -> int:
        """Return how much older (ns) than the newest the next message of a topic may be."""
        taken = self._taken[topic]
        if self._tolerance == 0 or len(taken) <= KNOWN:
            return self._tolerance
        return min(self._tolerance, (taken[-1] - taken[0]) // (2 * (len(taken) - 1)))

    def _drop_before(self, newest: int) -> None:
        assert self._begin is not None
        for k, queue in enumerate(self._waiting):
            while queue and newest - queue[0][0] > self._reach(k):
                if self._take(k)[0] < self._begin:
                    self.counts.early += 1
                else:
                    self.counts.incomplete += 1

    def _restart(self) -> None:
        self.counts.restarts += 1
        self._done += self._complete()
        self._begin = None
        for k, queue in enumerate(self._waiting):
            self.counts.incomplete += len(queue)
            queue.clear()
            self._taken[k].clear()
            self._last[k] = -(2**63)


def _flat(parts: Sequence[Values]) -> Values:
    return tuple(value for part in parts for value in part)
