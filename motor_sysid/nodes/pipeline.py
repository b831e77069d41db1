"""From raw messages to joined samples to estimates, without ROS: the identifier's working part.

The live node and the replay of a bag both use this, so that the same messages give the same
estimates, bit for bit.
"""

from collections import deque
from collections.abc import Collection, Sequence
from itertools import pairwise
import math
import time

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.stream import EstimateStream, Event
from motor_sysid.machine_code import kept
from motor_sysid.nodes.joining import Joining
from motor_sysid.nodes.topic_plan import TopicReader
from motor_sysid.nodes.topics import SignalPlan
from motor_sysid.nodes.window import Window
from motor_sysid.signals.clock_join import Sample
from motor_sysid.signals.join import Row
from motor_sysid.signals.phases import CURRENTS
from motor_sysid.signals.record import Provenance, Record, Samples

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Mask = NDArray[np.bool_]

SECOND = 1_000_000_000

NEVER = 2**63 - 1
"""Stamp of the last sample as long as there is none: any that comes begins anew."""

LONGEST_BACKLOG = 100_000
"""Samples that may wait for the estimator before the oldest are dropped."""


class Pipeline:
    """Joins the topics, converts to SI, and feeds the estimator.

    Parameters
    ----------
    plan:
        The topics, and what is made of them.
    readers:
        One for each topic.
    stream:
        The estimator; it is given the inputs and outputs by name.
    inputs, outputs:
        Signals that the estimator is given.
    window:
        Samples kept for a refit.
    tolerance:
        Largest difference of the stamps of one sample, ns.

    Attributes
    ----------
    plan, signals:
        The topics; every signal of the window, in order.
    not_finite:
        Samples with a value that is no finite number where one is needed, and messages without a
        stamp that can be one.
    overrun:
        Samples dropped because the estimator is slower than they come.
    """

    def __init__(
        self,
        plan: SignalPlan,
        readers: Sequence[TopicReader],
        stream: EstimateStream,
        inputs: Sequence[str],
        outputs: Sequence[str],
        window: int = 20_000,
        tolerance: int = 0,
    ) -> None:
        self.plan, self._readers = plan, tuple(readers)
        self.join = Joining(plan, window, tolerance)
        self.stream, self.not_finite = stream, 0
        self.signals = plan.signals
        self._columns = (
            np.array([self.signals.index(name) for name in inputs]),
            np.array([self.signals.index(n) if n in self.signals else -1 for n in outputs]),
        )
        self._currents = [self.signals.index(name) for name in CURRENTS if name in self.signals]
        self._speed = self.signals.index('speed') if 'speed' in self.signals else -1
        self._needed = self._without('speed' if 'position' in self.signals else '')
        self.window = Window(window, len(self.signals))
        self._last = NEVER
        self._compile()
        self._starts = np.empty(0, dtype=np.int64)
        self._ready: deque[Row | Sample] = deque()
        self._cost = 1e-4
        self.overrun = 0

    def _compile(self) -> None:
        """Compile everything before the first sample."""
        stamps, values = np.zeros(1, dtype=np.int64), np.zeros((1, len(self.signals)))
        self.window.append(stamps, values, _arrange(values, self._needed, *self._columns)[0])
        self.window.clear()
        _fall_back(stamps, NEVER)

    def _without(self, spare: str) -> NDArray[np.int64]:
        """Return the columns without which no sample is good: all but that of one signal.

        It is the position, or the speed as long as that has had no value.
        """
        return np.array([k for k, name in enumerate(self.signals) if name != spare])

    @property
    def doubts(self) -> list[str]:
        """What is odd about the messages of the topics, in words."""
        return [text for reader in self._readers for text in reader.doubts.values()]

    @property
    def foreign(self) -> tuple[int, ...]:
        """Messages of each topic that had none of its signals, and were left out."""
        return tuple(reader.foreign for reader in self._readers)

    def push(self, topic: int, data: bytes, received: int) -> None:
        """Take one message as raw CDR, received at that time in ns."""
        read = self._readers[topic].read(data, received)
        if read is None:
            return
        stamp, values = read
        if stamp is None:
            self.not_finite += 1
        else:
            self.join.push(topic, stamp, values)

    def collect(self) -> int:
        """Join what was pushed; return how many samples wait to be worked on."""
        self._ready.extend(self.join.pop())
        surplus = len(self._ready) - LONGEST_BACKLOG
        for _ in range(surplus):
            self._ready.popleft()
        self.overrun += max(surplus, 0)
        return len(self._ready)

    def advance(self, budget: float = math.inf) -> list[Event]:
        """Work on the samples that are complete; return what is to be published.

        Parameters
        ----------
        budget:
            Stop before about this much time (s) has passed, or when there is something to publish;
            the rest stays for the next call.  What comes out does not depend on it.
        """
        begin, worked = time.perf_counter(), False
        events: list[Event] = []
        while self.collect():
            left = budget - (time.perf_counter() - begin)
            if worked and (left < self._cost or (events and budget < math.inf)):
                break
            size = len(self._ready) if budget == math.inf else int(max(left, 0) / self._cost) or 1
            rows = [self._ready.popleft() for _ in range(min(size, len(self._ready)))]
            start = time.perf_counter()
            events += self._work(rows)
            worked = True
            taken = (time.perf_counter() - start) / len(rows)
            self._cost = max(0.8 * self._cost + 0.2 * taken, 1e-6)
        return events

    def _work(self, rows: Sequence[Row | Sample]) -> list[Event]:
        stamps = np.array([row[0] for row in rows], dtype=np.int64)
        read = self.join.read(rows, self._begins(stamps))
        values = self._with_third(self.plan.with_computed(read.values))
        if self._speed >= 0 and np.isfinite(values[:, self._speed]).any():
            self._speed, self._needed = -1, self._without('position')
        good, inputs, outputs = _arrange(values, self._needed, *self._columns)
        self.not_finite += len(rows) - int(np.count_nonzero(good))
        self.window.append(stamps, values, good)
        return self._feed(stamps, inputs, outputs, self._fresh(read.fresh))

    def _with_third(self, values: Array) -> Array:
        """Return (K, columns) values with a phase current that has none made from the others."""
        if len(self._currents) < 3:
            return values
        three = values[:, self._currents]
        lacks = np.isnan(three)
        lacks &= np.count_nonzero(lacks, axis=1)[:, None] == 1
        if not np.any(lacks):
            return values
        values = values.copy()
        values[:, self._currents] = np.where(lacks, -np.nansum(three, axis=1)[:, None], three)
        return values

    def _fresh(self, read: Mask | None) -> Mask | None:
        """Return which outputs (K, n_y) were measured about then; what is computed counts so."""
        if read is None:
            return None
        computed = np.ones((read.shape[0], len(self.signals) - read.shape[1] + 1), dtype=np.bool_)
        return np.hstack([read, computed])[:, self._columns[1]]

    def _begins(self, stamps: Stamps) -> NDArray[np.bool_]:
        """Tell for each of (K,) stamps whether the estimator begins anew with it."""
        begins: NDArray[np.bool_] = _fall_back(stamps, self._last)
        self._last = int(stamps[-1])
        return begins | np.isin(stamps, self._starts) if self._starts.size else begins

    def start_at(self, stamps: Collection[int]) -> None:
        """Leave out what is before the first of these stamps (ns), and start anew at each."""
        self._starts = np.array(sorted(stamps), dtype=np.int64)

    def _feed(
        self, stamps: Stamps, inputs: Array, outputs: Array, fresh: Mask | None
    ) -> list[Event]:
        if not self._starts.size:
            return self.stream.feed(stamps, inputs, outputs, fresh)
        events: list[Event] = []
        cuts = np.flatnonzero(np.isin(stamps, self._starts))
        for start, stop in pairwise([0, *cuts.tolist(), stamps.size]):
            if stop > start and stamps[start] >= self._starts[0]:
                if stamps[start] in self._starts:
                    self.stream.reset()
                rows = slice(start, stop)
                shown = None if fresh is None else fresh[rows]
                events += self.stream.feed(stamps[rows], inputs[rows], outputs[rows], shown)
        return events

    def reset(self) -> None:
        """Start anew with the next complete sample; what was pushed and waits is left out."""
        self.collect()
        self._ready.clear()
        self._last = NEVER
        self.stream.reset()
        self.window.clear()

    def record(self, seconds: float = math.inf) -> Record | None:
        """Return the last samples as a record; None if there are too few."""
        stamps, values = self.window.last()
        keep = stamps > (stamps[-1] - seconds * SECOND if stamps.size else 0)
        stamps, values = stamps[keep], values[keep]
        if stamps.size < 2:
            return None
        finite = [
            k
            for k, name in enumerate(self.signals)
            if not name.startswith('_') and np.isfinite(values[:, k]).all()
        ]
        time = (stamps - stamps[0]) / SECOND
        return Record(
            time,
            {self.signals[k]: values[:, k] for k in finite},
            {self.signals[k]: self.plan.sources[k].si_unit() for k in finite},
            Provenance('live topics'),
            samples=self._samples(stamps, {self.signals[k] for k in finite}),
        )

    def _samples(self, stamps: Stamps, names: Collection[str]) -> dict[str, Samples]:
        """Return what was measured at other times than those of the rows (N,), by signal."""
        first, last = 0.0, (stamps[-1] - stamps[0]) / SECOND
        return {
            name: Samples((own - stamps[0]) / SECOND, values).around(first, last)
            for name, (own, values) in self.join.sampled().items()
            if name in names and own.size > 1 and not np.all(np.isin(stamps, own))
        }


@kept()
def _fall_back(stamps, last):  # type: ignore[no-untyped-def]
    """Return which stamps (K,) are not after the one before; `last` is before the first."""
    back = np.empty(stamps.size, dtype=np.bool_)
    for k in range(stamps.size):
        back[k] = stamps[k] <= last
        last = stamps[k]
    return back


@kept()
def _arrange(values, needed, inputs, outputs):  # type: ignore[no-untyped-def]
    """Return which samples (K,) are good, inputs (K, n_u), and outputs (K, n_y), NaN if absent.

    The others are columns of the values (K, width); that of an absent output is -1.
    """
    good = np.ones(values.shape[0], dtype=np.bool_)
    u, y = np.empty((good.size, inputs.size)), np.empty((good.size, outputs.size))
    for k in range(good.size):
        for j in needed:
            good[k] = good[k] and math.isfinite(values[k, j])
        for j in range(inputs.size):
            u[k, j] = values[k, inputs[j]]
        for j in range(outputs.size):
            y[k, j] = values[k, outputs[j]] if outputs[j] >= 0 else np.nan
    return good, u, y
