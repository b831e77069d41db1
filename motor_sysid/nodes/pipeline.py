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
from motor_sysid.nodes.topics import OPTIONAL, SignalPlan
from motor_sysid.recording.field_reader import FieldReader
from motor_sysid.signals.join import Row, StampJoin
from motor_sysid.signals.record import Provenance, Record

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

SECOND = 1_000_000_000

LONGEST_BACKLOG = 100_000
"""Samples that may wait for the estimator before the oldest are dropped."""


class Window:
    """The last samples, in a ring of fixed size.

    Parameters
    ----------
    capacity:
        Samples kept.
    width:
        Values of one sample.
    """

    def __init__(self, capacity: int, width: int) -> None:
        self._stamps = np.zeros(capacity, dtype=np.int64)
        self._values = np.zeros((capacity, width))
        self._end = 0
        self._count = 0

    def __len__(self) -> int:
        """Return the number of samples held."""
        return self._count

    def append(self, stamps: Stamps, values: Array) -> None:
        """Add (K,) stamps and (K, width) values."""
        if not stamps.size:
            return
        capacity = self._stamps.size
        stamps, values = stamps[-capacity:], values[-capacity:]
        rows = (self._end + np.arange(stamps.size)) % capacity
        self._stamps[rows], self._values[rows] = stamps, values
        self._end = int(rows[-1] + 1) % capacity
        self._count = min(self._count + stamps.size, capacity)

    def clear(self) -> None:
        """Forget all samples."""
        self._count = self._end = 0

    def last(self) -> tuple[Stamps, Array]:
        """Return the samples in order: (N,) stamps in ns, (N, width) values."""
        rows = (self._end - self._count + np.arange(self._count)) % self._stamps.size
        return self._stamps[rows], self._values[rows]


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
    signals:
        Every signal of the window, in order.
    not_finite:
        Samples with a value that is no finite number where one is needed.
    overrun:
        Samples dropped because the estimator is slower than they come.
    """

    def __init__(
        self,
        plan: SignalPlan,
        readers: Sequence[FieldReader],
        stream: EstimateStream,
        inputs: Sequence[str],
        outputs: Sequence[str],
        window: int = 20_000,
        tolerance: int = 0,
    ) -> None:
        self._plan, self._readers = plan, tuple(readers)
        self._stamped = [len(topic.stamp) for topic in plan.topics]
        self.join = StampJoin(len(plan.topics), tolerance=tolerance)
        self.stream, self.not_finite = stream, 0
        self.signals = plan.signals
        self._inputs = [self.signals.index(name) for name in inputs]
        self._outputs = [self.signals.index(n) if n in self.signals else -1 for n in outputs]
        self._needed = [k for k, name in enumerate(self.signals) if name not in OPTIONAL]
        self.window = Window(window, len(self.signals))
        self._starts = np.empty(0, dtype=np.int64)
        self._ready: deque[Row] = deque()
        self._cost = 1e-4
        self.overrun = 0

    def push(self, topic: int, data: bytes, received: int) -> None:
        """Take one message as raw CDR, received at that time in ns."""
        values = self._readers[topic].read(data)
        if self._stamped[topic]:
            stamp = int(values[0]) * SECOND + int(values[1])
            self.join.push(topic, stamp, values[2:])
        else:
            self.join.push(topic, received, values)

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

    def _work(self, rows: Sequence[Row]) -> list[Event]:
        stamps = np.array([row[0] for row in rows], dtype=np.int64)
        values = self._plan.columns(np.array([row[1] for row in rows], dtype=np.float64))
        good = np.isfinite(values[:, self._needed]).all(axis=1)
        self.not_finite += int(good.size - good.sum())
        self.window.append(stamps[good], values[good])
        return self._feed(stamps, values[:, self._inputs], self._measured(values))

    def _measured(self, values: Array) -> Array:
        outputs = values[:, self._outputs]
        outputs[:, [k < 0 for k in self._outputs]] = np.nan
        return outputs

    def start_at(self, stamps: Collection[int]) -> None:
        """Leave out what is before the first of these stamps (ns), and start anew at each."""
        self._starts = np.array(sorted(stamps), dtype=np.int64)

    def _feed(self, stamps: Stamps, inputs: Array, outputs: Array) -> list[Event]:
        if not self._starts.size:
            return self.stream.feed(stamps, inputs, outputs)
        events: list[Event] = []
        cuts = np.flatnonzero(np.isin(stamps, self._starts))
        for start, stop in pairwise([0, *cuts.tolist(), stamps.size]):
            if stop > start and stamps[start] >= self._starts[0]:
                if stamps[start] in self._starts:
                    self.stream.reset()
                rows = slice(start, stop)
                events += self.stream.feed(stamps[rows], inputs[rows], outputs[rows])
        return events

    def reset(self) -> None:
        """Start anew with the next sample."""
        self._ready.clear()
        self.stream.reset()
        self.window.clear()

    def record(self, seconds: float = math.inf) -> Record | None:
        """Return the last samples as a record; None if there are too few or time falls back."""
        stamps, values = self.window.last()
        keep = stamps > (stamps[-1] - seconds * SECOND if stamps.size else 0)
        stamps, values = stamps[keep], values[keep]
        if stamps.size < 2 or np.any(np.diff(stamps) <= 0):
            return None
        finite = [
            k
            for k, name in enumerate(self.signals)
            if not name.startswith('_') and np.isfinite(values[:, k]).all()
        ]
        return Record(
            (stamps - stamps[0]) / SECOND,
            {self.signals[k]: values[:, k] for k in finite},
            {self.signals[k]: self._plan.sources[k].si_unit() for k in finite},
            Provenance('live topics'),
        )
