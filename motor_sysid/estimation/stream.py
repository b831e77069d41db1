"""Feed samples to an online estimator as they come, and say what is to be published when.

What is published depends on the samples alone, never on how they were bunched or when they
arrived: a replay of the same samples gives the same events, bit for bit.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import hashlib
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

SECOND = 1_000_000_000
LEARNED = 50
"""Samples from which the sample time is learned."""

Estimate = tuple[float, float, str, bool]
"""Value, standard deviation, unit, whether the data so far identify it."""


class Online(Protocol):
    """What an online estimator offers; see `motor_sysid.estimation.online`."""

    def update(self, t: Array, inputs: Array, outputs: Array) -> None:
        """Take (K,) times in s with (K, n_u) inputs and (K, n_y) outputs, one after the other."""

    def estimate(self) -> Mapping[str, Estimate]:
        """Return the estimates by parameter name."""

    def prediction(self) -> Mapping[str, float]:
        """Return what was predicted for the last sample, by output."""

    def residual(self) -> Mapping[str, float]:
        """Return measured minus predicted for the last sample, by output."""


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
    """

    def __init__(self, make: Callable[[float], Online], rates: Rates) -> None:
        self._make, self._rates = make, rates
        self.gaps = self.missing = 0
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next sample is the first."""
        self._online: Online | None = None
        self._early: list[tuple[Stamps, Array, Array]] = []
        self._first = self._last = -1
        self.samples = 0
        self._step = self._rates.sample
        self._digest = hashlib.blake2b(digest_size=8)

    @property
    def sample_time(self) -> float:
        """Sample time in s, 0 as long as it is not known."""
        return self._step / SECOND

    def feed(self, stamps: Stamps, inputs: Array, outputs: Array) -> list[Event]:
        """Take the next samples; return what is to be published.

        Parameters
        ----------
        stamps:
            (K,) ns; where they fall back, the source started anew, and so does the estimator.
        inputs, outputs:
            (K, n_u) and (K, n_y).
        """
        events: list[Event] = []
        steps = np.diff(stamps, prepend=self._last if self._last >= 0 else stamps[:1] - 1)
        for rows in _split(stamps.size, np.flatnonzero(steps <= 0)):
            if steps[rows.start] <= 0:
                self.reset()
            events += self._run(stamps[rows], inputs[rows], outputs[rows])
        return events

    def _run(self, stamps: Stamps, inputs: Array, outputs: Array) -> list[Event]:
        if self._first < 0:
            self._first = int(stamps[0])
        if self._online is None:
            self._early.append((stamps, inputs, outputs))
            self._last = int(stamps[-1])
            ready = self._learn()
            return self._process(*ready) if ready else []
        return self._process(stamps, inputs, outputs)

    def _learn(self) -> tuple[Stamps, Array, Array] | None:
        """Make the estimator once the sample time is known; returns what waited for it."""
        stamps = np.concatenate([part[0] for part in self._early])
        if not self._step:
            if stamps.size < LEARNED:
                return None
            self._step = int(np.median(np.diff(stamps[:LEARNED])))
        self._online = self._make(self.sample_time)
        waited = self._early
        self._early, self._last = [], -1
        return stamps, *(np.concatenate([part[k] for part in waited]) for k in (1, 2))  # type: ignore[return-value]

    def _process(self, stamps: Stamps, inputs: Array, outputs: Array) -> list[Event]:
        self._note_gaps(stamps)
        before = self._last if self._last >= 0 else int(stamps[0])
        since = np.concatenate([[before], stamps]) - self._first
        estimates = np.diff(since // self._rates.estimate) > 0
        due = estimates | (np.diff(since // self._rates.prediction) > 0)
        events: list[Event] = []
        for rows in _split(stamps.size, np.flatnonzero(due) + 1):
            self._update(stamps[rows], inputs[rows], outputs[rows])
            if due[rows.stop - 1]:
                events.append(self._event(bool(estimates[rows.stop - 1])))
        return events

    def _update(self, stamps: Stamps, inputs: Array, outputs: Array) -> None:
        assert self._online is not None
        self._online.update((stamps - self._first) / SECOND, inputs, outputs)
        self._digest.update(np.column_stack([stamps.view(np.float64), inputs, outputs]).tobytes())
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
            self._digest.copy().hexdigest() if with_estimate else '',
            self._online.estimate() if with_estimate else None,
        )

    def _note_gaps(self, stamps: Stamps) -> None:
        start = stamps[:1] if self._last < 0 else np.array([self._last])
        steps = np.diff(np.concatenate([start, stamps]))
        gaps = steps[steps > 1.5 * self._step]
        self.gaps += gaps.size
        self.missing += int(np.sum(np.rint(gaps / self._step) - 1))


def _split(size: int, cuts: NDArray[np.intp]) -> list[slice]:
    """Return the slices between the cuts; none is empty."""
    edges = sorted({0, size, *(int(c) for c in cuts)})
    return [slice(a, b) for a, b in pairwise(edges)]
