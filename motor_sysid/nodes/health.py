"""How the intake and the model fare: counts, times and errors for /diagnostics."""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import math
import time

from motor_sysid.estimation.stream import Event
from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.pipeline import Pipeline
from motor_sysid.nodes.statuses import Status
from motor_sysid.nodes.times import Times

SHARES = {'p50': 0.5, 'p90': 0.9, 'p99': 0.99, 'p99_9': 0.999, 'max': 1.0}
ERRORS = 500
"""Residuals over which the model error is averaged."""
PAUSE = 10
"""One gap of more samples than this was a pause, not a loss."""
SELDOM = 3
"""Mean times between two messages of a topic after which it is silent."""


@dataclass
class Batch:
    """One look at the topics; `taken` is when their messages were in (`time.perf_counter`)."""

    messages: int = 0
    waiting: bool = False
    taken: float = 0.0


@dataclass(frozen=True)
class Totals:
    """Where the counts stand: what has risen since the last report says how it goes now.

    Attributes
    ----------
    time, cpu:
        s of the steady clock, and of processor time.
    received, foreign:
        Messages of each topic, and those of them that had none of its signals.
    joined, lost:
        Samples that were complete; messages and samples lost or dropped.
    gaps, missing:
        Of the stamps, and the samples missing there.
    """

    time: float
    cpu: float
    received: tuple[int, ...]
    foreign: tuple[int, ...]
    joined: int
    lost: int
    gaps: int
    missing: int


class Rhythm:
    """How often a topic is heard: one that speaks seldom is not silent in between."""

    def __init__(self) -> None:
        self._first, self._last, self._count = math.nan, math.nan, 0

    def is_silent(self, now: float, heard: int) -> bool:
        """Tell whether it is silent now, in s, after so many messages since the last report."""
        if heard:
            self._first = self._first if self._count else now
            self._last, self._count = now, self._count + heard
            return False
        usual = (self._last - self._first) / max(self._count, 1)
        return not self._count or now - self._last > SELDOM * usual


class Health:
    """Collects what /diagnostics says about an identifier.

    Attributes
    ----------
    refits:
        Refits that came back.
    """

    def __init__(self, pipeline: Pipeline, topics: Sequence[RawTopic]) -> None:
        self._pipeline, self._topics = pipeline, topics
        self._intake, self._times, self._cpu = Times(), Times(), Times()
        self._residuals: dict[str, deque[float]] = {}
        self._rhythms = [Rhythm() for _ in topics]
        self._before = self._totals()
        self.refits = 0

    @contextmanager
    def timed(self) -> Iterator[Batch]:
        """Measure one batch; empty ones do not count."""
        batch = Batch()
        begin, worked = time.perf_counter(), time.thread_time()
        yield batch
        if batch.messages:
            self._intake.add(batch.taken - begin)
        if batch.messages or batch.waiting:
            self._times.add(time.perf_counter() - begin)
            self._cpu.add(time.thread_time() - worked)

    def note(self, event: Event) -> None:
        """Remember the residuals; after a gap there are none."""
        for name, value in event.residual.items():
            if math.isfinite(value):
                self._residuals.setdefault(name, deque(maxlen=ERRORS)).append(value)

    def _totals(self) -> Totals:
        pipeline, counts = self._pipeline, self._pipeline.join.counts
        lost = sum(topic.lost for topic in self._topics) + counts.dropped
        return Totals(
            time.monotonic(),
            time.process_time(),
            tuple(topic.received for topic in self._topics),
            pipeline.foreign,
            counts.joined,
            lost + pipeline.not_finite + pipeline.overrun,
            pipeline.stream.gaps,
            pipeline.stream.missing,
        )

    def statuses(self, noise: Mapping[str, float]) -> list[Status]:
        """Return the statuses; levels, rates and CPU share are those since the last call."""
        before, self._before = self._before, self._totals()
        return [self._traffic(before, self._before), self._model(noise)]

    def _traffic(self, before: Totals, now: Totals) -> Status:
        counts, stream = self._pipeline.join.counts, self._pipeline.stream
        passed = max(now.time - before.time, 1e-9)
        values: dict[str, object] = {
            'messages_per_s': (sum(now.received) - sum(before.received)) / passed,
            'samples': stream.samples,
            'sample_time_s': stream.sample_time,
            **{f'lost {topic.resolved}': topic.lost for topic in self._topics},
            'foreign': sum(now.foreign),
            'early': counts.early,
            'incomplete': counts.incomplete,
            'out_of_order': counts.out_of_order,
            'overflow': counts.overflow,
            'restarts': counts.restarts,
            'clock': self._pipeline.join.told,
            'not_finite': self._pipeline.not_finite,
            'overrun': self._pipeline.overrun,
            'backlog': self._pipeline.collect(),
            'gaps': stream.gaps,
            'missing': stream.missing,
            'cpu_share': (now.cpu - before.cpu) / passed,
            'refits': self.refits,
            **self._percentiles(),
        }
        if trouble := self._trouble(before, now):
            return Status('intake', values, trouble, warn=True)
        missing = now.missing - before.missing
        pause = f'paused for {missing * stream.sample_time:.2g} s' if missing else 'ok'
        return Status('intake', values, pause)

    def _trouble(self, before: Totals, now: Totals) -> str:
        """Say what has gone wrong since the last report, or nothing."""
        news = [since - then for then, since in zip(before.received, now.received, strict=True)]
        both = zip(self._topics, self._rhythms, news, strict=True)
        silent = [topic.resolved for topic, one, new in both if one.is_silent(now.time, new)]
        if silent:
            return f'nothing heard of {", ".join(silent)}'
        for k, topic in enumerate(self._pipeline.plan.topics):
            if news[k] and news[k] == now.foreign[k] - before.foreign[k]:
                fields = ' or '.join(f'`{source.field}`' for source in topic.sources)
                return f'no message of {self._topics[k].resolved} has {fields}'
        if now.joined == before.joined and all(news):
            if self._pipeline.join.waits:
                return 'waiting for the first messages of each topic, which tell how to join them'
            return (
                'no sample is complete: the stamps of the topics have no time in common; '
                'synchronise the clocks, or give `stamp: receive` in a msg_config file'
            )
        missing, gaps = now.missing - before.missing, now.gaps - before.gaps
        paused = gaps == 1 and missing > PAUSE
        if now.lost > before.lost or (missing and not paused):
            return 'samples were lost'
        return ''

    def _percentiles(self) -> dict[str, float]:
        """Say how long it took to take messages in, and the whole batch with the estimator.

        Both by the clock; the batch also in processor time, which a busy machine does not stretch.
        """
        kinds = {'intake': self._intake, 'batch': self._times, 'batch_cpu': self._cpu}
        return {
            f'{kind}_{name}_ms': 1e3 * times.percentile(share)
            for kind, times in kinds.items()
            for name, share in SHARES.items()
        }

    def _model(self, noise: Mapping[str, float]) -> Status:
        """Compare what the model leaves with the noise that the last refit found."""
        values: dict[str, object] = {}
        worst = 0.0
        for name, residuals in self._residuals.items():
            error = math.sqrt(sum(r * r for r in residuals) / len(residuals))
            values[f'error {name}'] = error
            if noise.get(name):
                values[f'noise {name}'] = float(noise[name])
                worst = max(worst, error / noise[name])
        if worst > 2:
            text = f'the model errs {worst:.1f} times the noise: something is missing'
            return Status('model', values, text, warn=True)
        return Status('model', values)
