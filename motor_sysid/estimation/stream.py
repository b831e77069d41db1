"""Feed samples to an online estimator as they come, and say what is to be published when.

What is published depends on the samples alone, never on how they were bunched or when they
arrived: a replay of the same samples gives the same events, bit for bit.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import hashlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.handover import Estimate, Handover, Online

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Mask = NDArray[np.bool_]

SECOND = 1_000_000_000
LEARNED = 50
"""Samples from which the sample time is learned."""


class Batch(NamedTuple):
    """Samples: (K,) stamps in ns, (K, n_u) inputs, (K, n_y) outputs and which are fresh."""

    stamps: Stamps
    inputs: Array
    outputs: Array
    fresh: Mask

    def rows(self, start: int, stop: int) -> 'Batch':
        """Return rows start to stop (exclusive)."""
        part = slice(start, stop)
        return Batch(self.stamps[part], self.inputs[part], self.outputs[part], self.fresh[part])


Make = Callable[[float], Online]
"""Makes an estimator for a sample time in s."""


@dataclass(frozen=True)
class Rates:
    """How often results are published, counted in sample time.

    Attributes
    ----------
    estimate, prediction:
        Period in ns.
    sample:
        Sample time in ns; 0 to learn it from the first stamps.
    """

    estimate: int = SECOND // 10
    prediction: int = SECOND // 50
    sample: int = 0


@dataclass(frozen=True)
class Event:
    """What is known after one sample.

    Attributes
    ----------
    stamp, first_stamp:
        Of this sample and of the first one that the estimator was given, ns.
    samples:
        How many it was given.
    digest:
        Of all that it was given, in order; empty without an estimate.
    prediction, residual:
        For this sample, by output.
    estimate:
        By parameter; None where only a prediction is due.
    """

    stamp: int
    first_stamp: int
    samples: int
    prediction: Mapping[str, float]
    residual: Mapping[str, float]
    digest: str = ''
    estimate: Mapping[str, Estimate] | None = None


class EstimateStream:
    """An online estimator with its clock.

    Parameters
    ----------
    make:
        Makes the estimator for a sample time in s.
    rates:
        How often results are published.

    Attributes
    ----------
    sample_time:
        In s; 0 as long as it is not known.
    samples:
        Samples given to the estimator since it was made.
    gaps, missing:
        How often stamps were more than 1.5 sample times apart, and the samples missing there.
    changed:
        Stamp in ns of the first sample that the present kind of estimator was given, if it took
        over from another; 0 before any change.
    """

    def __init__(self, make: Make, rates: Rates) -> None:
        self._make, self._rates = make, rates
        self._changes: deque[tuple[int | None, Make]] = deque()
        self.gaps = self.missing = self.changed = 0
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next sample is the first."""
        self._online: Online | None = None
        self._early: list[Batch] = []
        self._first = self._last = -1
        self.samples = 0
        self._step = self._rates.sample
        self._digests = tuple(hashlib.blake2b(digest_size=16) for _ in range(3))

    @property
    def sample_time(self) -> float:
        """Sample time in s, 0 as long as it is not known."""
        return self._step / SECOND

    @property
    def first_stamp(self) -> int:
        """Stamp of the first sample, ns; -1 before any."""
        return self._first

    def estimate(self) -> Mapping[str, Estimate]:
        """Return the estimates after the last sample; none before there is an estimator."""
        return self._online.estimate() if self._online else {}

    @property
    def waiting(self) -> bool:
        """Whether a change waits for its sample."""
        return bool(self._changes)

    def change(self, make: Make, at: int | None = None) -> None:
        """Have another estimator take over from the present one (see `Handover`).

        Parameters
        ----------
        make:
            Makes it, now and after every reset from then on.
        at:
            Stamp in ns of the first sample that it is given; None for the next sample, in place
            of another change that still waits for that.  Changes are made in the order of calls.
        """
        if at is None:
            self._changes = deque(one for one in self._changes if one[0] is not None)
        self._changes.append((at, make))

    def feed(
        self, stamps: Stamps, inputs: Array, outputs: Array, fresh: Mask | None = None
    ) -> list[Event]:
        """Take the next samples; return what is to be published.

        Parameters
        ----------
        stamps:
            (K,) ns; where they fall back, the source started anew, and so does the estimator.
        inputs, outputs:
            (K, n_u) and (K, n_y).
        fresh:
            (K, n_y) which outputs were measured then, and do not just lie between two that were;
            None for all.
        """
        whole = Batch(stamps, inputs, outputs, _all(outputs) if fresh is None else fresh)
        events: list[Event] = []
        times: list[int] = stamps.tolist()
        start = 0
        for stop in self._turns(times):
            if times[start] <= self._last:
                self.reset()
            self._turn(times[start])
            events += self._run(whole.rows(start, stop))
            start = stop
        return events

    def _turns(self, times: Sequence[int]) -> list[int]:
        """Return the ends of stretches without a fall back or the begin of a change."""
        last, ends = self._last, [len(times)]
        waiting = [at for at, _ in self._changes if at is not None]
        for k, time in enumerate(times):
            if k and (time <= last or any(last < at <= time for at in waiting)):
                ends.insert(-1, k)
            last = time
        return ends

    def _turn(self, stamp: int) -> None:
        """Make the changes that are due with the sample of this stamp."""
        while self._changes:
            at, make = self._changes[0]
            if at is not None and not self._last < at <= stamp:
                return
            self._changes.popleft()
            self._make, self.changed = make, stamp
            if self._online is not None:
                self._online = Handover(self._online, make(self.sample_time))

    def _run(self, batch: Batch) -> list[Event]:
        if self._first < 0:
            self._first = int(batch.stamps[0])
        if self._online is not None:
            return self._process(batch)
        self._early.append(batch)
        self._last = int(batch.stamps[-1])
        ready = self._learn()
        return self._process(ready) if ready else []

    def _learn(self) -> Batch | None:
        """Make the estimator once the sample time is known; returns what waited for it."""
        waited = Batch(*(np.concatenate(parts) for parts in zip(*self._early, strict=True)))
        if not self._step:
            if waited.stamps.size < LEARNED:
                return None
            self._step = int(np.median(np.diff(waited.stamps[:LEARNED])))
        self._online = self._make(self.sample_time)
        self._early, self._last = [], -1
        return waited

    def _process(self, batch: Batch) -> list[Event]:
        """Take samples whose stamps rise; an event is due where a period begins."""
        events: list[Event] = []
        times = batch.stamps.tolist()
        last, start = self._last if self._last >= 0 else times[0], 0
        for k, time in enumerate(times):
            self._note_gap(time - last)
            estimate = self._begins(self._rates.estimate, last, time)
            if estimate or self._begins(self._rates.prediction, last, time):
                self._update(batch.rows(start, k + 1))
                events.append(self._event(estimate))
                start = k + 1
            last = time
        if start < len(times):
            self._update(batch.rows(start, len(times)))
        return events

    def _begins(self, period: int, last: int, time: int) -> bool:
        """Tell whether a new period begins between two stamps."""
        return (time - self._first) // period > (last - self._first) // period

    def _update(self, batch: Batch) -> None:
        assert self._online is not None
        stamps, inputs, outputs, fresh = batch
        self._online.update((stamps - self._first) / SECOND, inputs, outputs, fresh)
        for digest, values in zip(self._digests, (stamps, inputs, outputs), strict=True):
            digest.update(values.tobytes())
        self.samples += stamps.size
        self._last = int(stamps[-1])

    def _event(self, with_estimate: bool) -> Event:
        assert self._online is not None
        return Event(
            self._last,
            self._first,
            self.samples,
            self._online.prediction(),
            self._online.residual(),
            self._digest() if with_estimate else '',
            self._online.estimate() if with_estimate else None,
        )

    def _note_gap(self, step: int) -> None:
        if step > 1.5 * self._step:
            self.gaps += 1
            self.missing += round(step / self._step) - 1

    def _digest(self) -> str:
        """Return a digest of all samples so far, which is the same however they were bunched."""
        parts = b''.join(digest.digest() for digest in self._digests)
        return hashlib.blake2b(parts, digest_size=8).hexdigest()


def _all(outputs: Array) -> Mask:
    return np.ones(outputs.shape, dtype=np.bool_)
