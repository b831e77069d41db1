"""How the messages of several topics become rows: by equal stamps, or by clocks of their own."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.nodes.angles import Angles
from motor_sysid.nodes.topic_plan import TopicPlan
from motor_sysid.nodes.topics import SignalPlan
from motor_sysid.nodes.window import Window
from motor_sysid.recording.align import fastest, is_regular
from motor_sysid.recording.rows import gap_limit
from motor_sysid.signals.channels import Role, role_of
from motor_sysid.signals.clock_join import Clock, ClockJoin, NEVER, Sample
from motor_sysid.signals.join import JoinCounts, LIMIT, RESTART, Row, StampJoin, Values

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Mask = NDArray[np.bool_]

SECOND = 1_000_000_000

LOOKS = ((3, 0.9), (20, 0.5))
"""After so many messages of each topic their stamps are equal if at least this share of those of
the fastest topic has partners; after the last look they are not."""
ALIKE = 1.5
"""Topics whose median steps differ by more than this factor do not come from one cycle, though
the slower one may share its stamps with every second message of the faster one."""
SLOW = 10
"""A measured topic of which so many times fewer messages came has a clock of its own."""
LONG = 2000
"""With so many messages of one topic, an input or a reference that says less is sent on change."""
KEPT = 8 * LIMIT
"""Most messages of one topic that wait for slower ones: three at 1 Hz beside 10 kHz."""


@dataclass(frozen=True)
class Read:
    """What was read for some rows.

    Attributes
    ----------
    values:
        (K, read) in SI, angles continuous.
    fresh:
        (K, read) whether it was measured about then; else it lies between two messages.  None
        where all was.
    """

    values: Array
    fresh: Mask | None = None


class Joining:
    """Joins topics on equal stamps, or each with its own clock on those of one topic.

    Which of both is found from the first messages, which wait until then: a robot's topics come
    from one cycle or from several.

    Parameters
    ----------
    plan:
        The topics.
    window:
        Messages kept of each topic that has its own clock.
    tolerance:
        Largest difference of stamps (ns) that count as equal; above 0 the nearest stamps go
        together, whatever they are.

    Attributes
    ----------
    counts:
        What became of the messages.
    clock:
        Topic whose stamps the rows have; empty where stamps are equal, or it is not known yet.
    """

    def __init__(self, plan: SignalPlan, window: int, tolerance: int = 0) -> None:
        self._plan, self._window = plan, window
        self.counts, self.clock = JoinCounts(), ''
        self._join: StampJoin | _Clocks | None = None
        if tolerance or len(plan.topics) < 2:
            self._join = StampJoin(len(plan.topics), tolerance=tolerance, counts=self.counts)
        self._first: tuple[list[Row], ...] = tuple([] for _ in plan.topics)
        self._held = [Role.MEASURED not in _roles(topic) for topic in plan.topics]
        self._angles = Angles(plan.read)
        self._compile()

    def _compile(self) -> None:
        """Compile before the first sample what takes angles."""
        self._angles.unwrap(np.zeros((1, len(self._plan.read))), np.ones(1, dtype=np.bool_))

    @property
    def told(self) -> str:
        """What the rows' stamps are, in words: those of a topic, equal ones, or not known yet."""
        if self._join is None:
            return 'not known yet'
        return self.clock or 'equal stamps'

    @property
    def waits(self) -> bool:
        """Whether all topics are heard, at the same time, but seldom enough to wait for more."""
        if self._join is not None or not all(self._first):
            return False
        return max(q[0][0] for q in self._first) <= min(q[-1][0] for q in self._first)

    def push(self, topic: int, stamp: int, values: Values) -> None:
        """Take one message: its stamp in ns and its values as they were sent."""
        if self._join is not None:
            self._join.push(topic, stamp, values)
            return
        queue = self._first[topic]
        if queue and stamp <= queue[-1][0]:
            if stamp > queue[-1][0] - RESTART:
                self.counts.out_of_order += 1
                return
            for one in self._first:
                self.counts.early += len(one)
                one.clear()
        if len(queue) >= KEPT:
            del queue[:LIMIT]
            self.counts.early += LIMIT
        queue.append((stamp, values))

    def pop(self) -> Sequence[Row | Sample]:
        """Return the rows that are complete, in order."""
        if self._join is None and all(self._first):
            self._choose()
        return self._join.pop() if self._join is not None else ()

    def read(self, rows: Sequence[Row | Sample], begins: Mask) -> Read:
        """Return what (K,) rows hold; `begins` (K,) tells where rows begin anew."""
        if isinstance(self._join, _Clocks):
            return self._join.read(rows, begins)
        values = self._plan.to_si(np.array([row[1] for row in rows], dtype=np.float64))
        self._angles.unwrap(values, begins)
        return Read(values)

    def sampled(self) -> dict[str, tuple[Stamps, Array]]:
        """Return measured signals that have stamps of their own: (N,) ns and (N,) values in SI."""
        return self._join.sampled() if isinstance(self._join, _Clocks) else {}

    def _choose(self) -> None:
        """Choose how to join, if the first messages tell."""
        begin = max(queue[0][0] for queue in self._first)
        starts = [bisect_left(queue, begin, key=_stamp) for queue in self._first]
        for count, share in LOOKS:
            end = self._end(starts, count)
            if end is None:
                return
            seen = [
                [stamp for stamp, _ in queue[start : bisect_right(queue, end, key=_stamp)]]
                for queue, start in zip(self._first, starts, strict=True)
            ]
            most = max(map(len, seen))
            if _with_partners(seen) >= share * most and _are_alike(seen):
                self._join = StampJoin(len(seen), counts=self.counts)
                break
            measured = [own for own, held in zip(seen, self._held, strict=True) if not held]
            if most >= SLOW * min(map(len, measured)):
                break
        self._hand_on(self._join or self._clocks(seen))

    def _end(self, starts: Sequence[int], count: int) -> int | None:
        """Return the stamp up to which so many messages of each topic are known; None if not.

        Those at `starts` are the first that count.
        """
        queues = [(q, start, len(q) - start) for q, start in zip(self._first, starts, strict=True)]
        busy = max(size for *_, size in queues) >= LONG
        for held, (*_, size) in zip(self._held, queues, strict=True):
            if size < count and not (held and busy):
                return None
        told = [(queue, start) for queue, start, size in queues if size >= count]
        end = max(queue[start + count - 1][0] for queue, start in told)
        return end if all(queue[-1][0] >= end for queue, _ in told) else None

    def _clocks(self, stamps: Sequence[Sequence[int]]) -> '_Clocks':
        """Return a join on the stamps of one topic, by those of the first messages of each."""
        signals = [[source.signal for source in topic.sources] for topic in self._plan.topics]
        base = fastest([len(own) for own in stamps], signals, self._plan.base_clock)
        self.clock = self._plan.topics[base].topic
        return _Clocks(self._plan, stamps, base, self.counts, self._window)

    def _hand_on(self, join: 'StampJoin | _Clocks') -> None:
        """Give the messages that waited for the choice to what was chosen."""
        self._join = join
        for k, queue in enumerate(self._first):
            for stamp, values in queue:
                join.push(k, stamp, values)
            queue.clear()


class _Clocks:
    """Topics with clocks of their own, in SI and continuous before they are interpolated.

    Beside each value goes what was added to its angle, so that rows can begin anew without it.
    """

    def __init__(
        self, plan: SignalPlan, stamps: Sequence[Sequence[int]], base: int, counts: JoinCounts,
        window: int,
    ) -> None:  # fmt: skip
        self._topics, self._counts, self._base = plan.topics, counts, base
        clocks = [
            _clock(topic, np.array(own, dtype=np.int64))
            for topic, own in zip(plan.topics, stamps, strict=True)
        ]
        self._join = ClockJoin(clocks, base, counts, KEPT)
        sizes = [len(topic.sources) for topic in plan.topics]
        self._angles = [Angles(topic.sources) for topic in plan.topics]
        self._windows = [Window(window, size) for size in sizes]
        self._new: list[list[Row]] = [[] for _ in sizes]
        self._last = [NEVER] * len(sizes)
        ends = 2 * np.cumsum(sizes)
        self._of_topic = np.repeat(np.arange(len(sizes)), sizes)
        self._value = np.concatenate(
            [end - 2 * size + np.arange(size) for end, size in zip(ends, sizes, strict=True)]
        )
        self._added = self._value + np.repeat(sizes, sizes)
        self._turns = np.zeros(sum(sizes))

    def push(self, topic: int, stamp: int, values: Values) -> None:
        """Take one message as it was sent."""
        self._new[topic].append((stamp, values))

    def pop(self) -> list[Sample]:
        """Return the rows that every topic has reached."""
        for k, messages in enumerate(self._new):
            if messages:
                self._take(k, messages)
                messages.clear()
        return self._join.pop()

    def _take(self, topic: int, messages: Sequence[Row]) -> None:
        """Convert new messages of one topic, remember them and hand them on."""
        good, begins = [], []
        for message in messages:
            stamp, last = message[0], self._last[topic]
            if last - RESTART < stamp <= last:
                self._counts.out_of_order += 1
                continue
            good.append(message)
            begins.append(stamp <= last or last == NEVER)
            self._last[topic] = stamp
        if not good:
            return
        sources = self._topics[topic].sources
        raw = np.array([values for _, values in good], dtype=np.float64)
        sent = np.column_stack([one.to_si(raw[:, k]) for k, one in enumerate(sources)])
        values = sent.copy()
        self._angles[topic].unwrap(values, np.array(begins))
        stamps = np.array([stamp for stamp, _ in good], dtype=np.int64)
        self._windows[topic].append(stamps, values, np.ones(stamps.size, dtype=np.bool_))
        both = np.hstack([values, values - sent])
        for stamp, row in zip(stamps.tolist(), both.tolist(), strict=True):
            self._join.push(topic, stamp, tuple(row))

    def read(self, rows: Sequence[Row | Sample], begins: Mask) -> Read:
        """Return what (K,) rows hold: angles as if their first message came where rows begin."""
        both = np.array([row[1] for row in rows])
        added = both[:, self._added]
        start = np.maximum.accumulate(np.where(begins, np.arange(begins.size), -1))
        turns = np.where((start < 0)[:, None], self._turns, added[start])
        self._turns = turns[-1]
        fresh = np.array([row[2] for row in rows if isinstance(row, Sample)])
        return Read(both[:, self._value] - turns, fresh[:, self._of_topic])

    def sampled(self) -> dict[str, tuple[Stamps, Array]]:
        """Return the measured signals of all topics but the base clock's."""
        found = {}
        for k, source in enumerate(source for topic in self._topics for source in topic.sources):
            topic = int(self._of_topic[k])
            if topic != self._base and role_of(source.signal) is Role.MEASURED:
                stamps, values = self._windows[topic].last()
                column = values[:, k - int(np.argmax(self._of_topic == topic))]
                finite = np.isfinite(column)
                found[source.signal] = stamps[finite], column[finite] - self._turns[k]
        return found


def _stamp(row: Row) -> int:
    return row[0]


def _roles(topic: TopicPlan) -> tuple[Role, ...]:
    return tuple(role_of(source.signal) for source in topic.sources)


def _clock(topic: TopicPlan, stamps: Stamps) -> Clock:
    """Return how a topic keeps time, by the stamps of its first messages (N,)."""
    roles = _roles(topic)
    steps = np.diff(stamps)
    reach = gap_limit((stamps - stamps[:1]) / SECOND)
    on_change = Role.MEASURED not in roles and not is_regular(stamps)
    return Clock(
        (*roles, *(Role.STEPPED for _ in roles)),
        int(np.median(steps)) if steps.size else 0,
        None if on_change or not np.isfinite(reach) else round(reach * SECOND),
    )


def _with_partners(stamps: Sequence[Sequence[int]]) -> int:
    """Return how many stamps all topics have in common."""
    join = StampJoin(len(stamps))
    for topic, own in enumerate(stamps):
        for stamp in own:
            join.push(topic, stamp, ())
    return len(join.pop())


def _are_alike(stamps: Sequence[Sequence[int]]) -> bool:
    """Tell whether topics, of some messages each, are equally fast."""
    steps = [float(np.median(np.diff(own))) for own in stamps]
    return max(steps) <= ALIKE * min(steps)
