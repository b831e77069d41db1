"""Carry the messages of topics with clocks of their own to the stamps of one of them, live."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from motor_sysid.signals.channels import Role
from motor_sysid.signals.join import JoinCounts, LIMIT, RESTART, Row, Values

NEVER = -(2**63)
PATIENCE = 250_000_000
"""A row waits so long (ns of the base clock) for an input or a reference, which may be sent on
change only; what it held goes on then."""
NEAR = 1.5
"""A row ends where the next one begins, unless that is more than so many periods later."""


class Sample(NamedTuple):
    """One row.

    Attributes
    ----------
    stamp:
        Of the base clock, ns.
    values:
        Of all topics, in their order.
    fresh:
        For each topic, whether one of its messages lies nearest to this row.
    """

    stamp: int
    values: Values
    fresh: tuple[bool, ...]


@dataclass(frozen=True)
class Clock:
    """How one topic keeps time.

    Attributes
    ----------
    roles:
        Of its columns: what is measured is interpolated, a reference held, an input averaged over
        the row (see `motor_sysid.signals.record.resample`).
    period:
        Usual time between two messages, ns.
    reach:
        Longest time between two messages across which it has something to say, ns; None if it
        holds until the next one, whenever that comes.
    """

    roles: tuple[Role, ...]
    period: int
    reach: int | None

    @property
    def held(self) -> bool:
        """Whether nothing of it is measured."""
        return Role.MEASURED not in self.roles


@dataclass
class _Waiting:
    """Messages of one topic; of those that are past, the last one stays."""

    clock: Clock
    queue: deque[Row] = field(default_factory=deque)
    last: int = NEVER
    first: int = NEVER


class ClockJoin:
    """Gives every row of the base clock what the other topics had to say at that time.

    The rows depend on the messages alone, not on how their arrivals interleave: a row waits until
    every topic has reached it.  Only an input or a reference may be silent: it is taken to hold
    where the base clock is `PATIENCE` ahead of the row.

    Rows begin where every topic has been heard; after a restart they begin anew.

    Parameters
    ----------
    clocks:
        One for each topic.
    base:
        Number of the topic whose stamps are the rows'.
    counts:
        Told what becomes of the messages: a row that a topic cannot fill is `incomplete`.
    limit:
        Most messages that wait on one topic.
    """

    def __init__(
        self, clocks: Sequence[Clock], base: int, counts: JoinCounts, limit: int = LIMIT
    ) -> None:
        self.counts = counts
        self._topics = tuple(_Waiting(clock) for clock in clocks)
        self._base, self._limit = self._topics[base], limit
        self._rest = tuple(topic for topic in self._topics if topic is not self._base)
        self._whole = any(Role.INPUT in topic.clock.roles for topic in self._rest)
        self._done: list[Sample] = []

    def push(self, topic: int, stamp: int, values: Values) -> None:
        """Take one message: its stamp in ns and its values."""
        waiting = self._topics[topic]
        if stamp <= waiting.last:
            if stamp > waiting.last - RESTART:
                self.counts.out_of_order += 1
                return
            self._restart()
        if waiting.first == NEVER:
            waiting.first = stamp
        waiting.last = stamp
        if len(waiting.queue) >= self._limit:
            waiting.queue.popleft()
            if self._begin is None:
                self.counts.early += 1
            else:
                self.counts.overflow += 1
        waiting.queue.append((stamp, values))

    def pop(self) -> list[Sample]:
        """Return the rows that every topic has reached, in order."""
        rows, self._done = [*self._done, *self._complete()], []
        return rows

    @property
    def _begin(self) -> int | None:
        """Stamp from which on every topic has been heard; None before."""
        first = [topic.first for topic in self._topics]
        return None if NEVER in first else max(first)

    def _complete(self) -> list[Sample]:
        rows: list[Sample] = []
        begin, queue = self._begin, self._base.queue
        if begin is None:
            return rows
        while len(queue) > self._whole:
            stamp, own = queue[0]
            end = self._end(stamp)
            if stamp >= begin and not all(self._reached(topic, end) for topic in self._rest):
                break
            queue.popleft()
            row = self._row(stamp, own, end) if stamp >= begin else None
            if row is not None:
                rows.append(row)
            elif stamp < begin:
                self.counts.early += 1
            else:
                self.counts.incomplete += 1
        self.counts.joined += len(rows)
        return rows

    def _end(self, stamp: int) -> int:
        """Return where the first row ends, ns."""
        queue, period = self._base.queue, self._base.clock.period
        step = queue[1][0] - stamp if len(queue) > 1 else period
        return stamp + (step if step <= NEAR * period else period)

    def _reached(self, topic: _Waiting, end: int) -> bool:
        """Tell whether all is known that a topic has to say up to the end of the first row."""
        stamp = self._base.queue[0][0]
        if topic.last >= (end if Role.INPUT in topic.clock.roles else stamp):
            return True
        return topic.clock.held and self._base.last - stamp >= PATIENCE

    def _row(self, stamp: int, own: Values, end: int) -> Sample | None:
        """Return a row; None where a topic has nothing to say."""
        parts: list[Values] = []
        fresh: list[bool] = []
        for topic in self._topics:
            if topic is self._base:
                parts.append(own)
                fresh.append(True)
                continue
            queue = topic.queue
            while len(queue) > 1 and queue[1][0] <= stamp:
                queue.popleft()
            if queue[0][0] > stamp or not _reaches(topic, stamp):
                return None
            parts.append(_carried(topic, stamp, end))
            fresh.append(self._is_near(topic, stamp))
        return Sample(stamp, tuple(value for part in parts for value in part), tuple(fresh))

    def _is_near(self, topic: _Waiting, stamp: int) -> bool:
        """Tell whether a message lies in the period around a row, so that each has one row."""
        queue, period = topic.queue, self._base.clock.period
        if 2 * (stamp - queue[0][0]) < period:
            return True
        return len(queue) > 1 and 2 * (queue[1][0] - stamp) <= period

    def _restart(self) -> None:
        self._done += self._complete()
        self.counts.restarts += 1
        for topic in self._topics:
            topic.queue.clear()
            topic.first = topic.last = NEVER


def _reaches(topic: _Waiting, stamp: int) -> bool:
    """Tell whether the messages around a stamp are near enough to speak of it."""
    queue, reach = topic.queue, topic.clock.reach
    before = queue[0][0]
    if reach is None or before == stamp:
        return True
    after = queue[1][0] if len(queue) > 1 and not topic.clock.held else stamp
    return after - before <= reach


def _carried(topic: _Waiting, stamp: int, end: int) -> Values:
    """Return the values of a topic for a row; its first message is the last one up to the row."""
    (before, values), queue = topic.queue[0], topic.queue
    inputs = Role.INPUT in topic.clock.roles and len(queue) > 1 and queue[1][0] < end
    if before == stamp and not inputs:
        return values
    mean = _mean(queue, stamp, end) if inputs else values
    if len(queue) == 1:
        return values
    after, following = queue[1]
    share = (stamp - before) / (after - before)
    return tuple(
        mean[k]
        if role is Role.INPUT
        else (1 - share) * values[k] + share * following[k]
        if role is Role.MEASURED and share
        else values[k]
        for k, role in enumerate(topic.clock.roles)
    )


def _mean(queue: deque[Row], stamp: int, end: int) -> Values:
    """Return the mean over a row of what is held from each message to the next."""
    total = [0.0] * len(queue[0][1])
    for k, (begin, values) in enumerate(queue):
        if begin >= end:
            break
        stop = min(queue[k + 1][0], end) if k + 1 < len(queue) else end
        share = (stop - max(begin, stamp)) / (end - stamp)
        for j, value in enumerate(values):
            total[j] += share * value
    return tuple(total)
