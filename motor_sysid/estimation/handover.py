"""One online estimator takes over from another without a jump.

A filter that has just begun knows neither the motion nor its parameters.  So both run side by side
for a while on the same samples, and the old one answers until the new one knows what the old one
knew (bumpless transfer).  When that is depends on the samples alone, so that a replay hands over
at the same sample.
"""

from collections.abc import Mapping
import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

Estimate = tuple[float, float, str, bool]
"""Value, standard deviation, unit, whether the data so far identify it."""

SOONEST, LATEST = 0.5, 3.0
"""The new estimator answers after so many s at the earliest and at the latest."""

LOOK = 0.1
"""Time between two looks at whether it is ready, s."""


class Online(Protocol):
    """What an online estimator offers; see `motor_sysid.estimation.online`."""

    def update(self, t: Array, inputs: Array, outputs: Array, fresh: Mask) -> None:
        """Take (K,) times in s with (K, n_u) inputs and (K, n_y) outputs, one after the other.

        `fresh` (K, n_y) tells which outputs were measured then, and do not lie between two that
        were.
        """

    def estimate(self) -> Mapping[str, Estimate]:
        """Return the estimates by parameter name."""

    def prediction(self) -> Mapping[str, float]:
        """Return what was predicted for the last sample, by output."""

    def residual(self) -> Mapping[str, float]:
        """Return measured minus predicted for the last sample, by output."""


class Handover:
    """Two estimators side by side, until the new one is ready.

    Parameters
    ----------
    old, new:
        The one that goes, which may itself be taking over, and the one that comes.
    """

    def __init__(self, old: Online, new: Online) -> None:
        self._old: Online | None = old
        self._new = new
        self._known = {name for name, found in old.estimate().items() if found[3]}
        self._begin = self._next = math.nan

    def update(self, t: Array, inputs: Array, outputs: Array, fresh: Mask) -> None:
        """Give samples to both, or to the new one alone once it is ready.

        Parameters
        ----------
        t:
            (K,) times in s.
        inputs, outputs, fresh:
            (K, n_u), (K, n_y) and (K, n_y), see `Online`.
        """
        start = 0
        while self._old is not None and start < t.size:
            if math.isnan(self._begin):
                self._begin, self._next = float(t[0]), float(t[0]) + SOONEST
            stop = start + 1 + int(np.searchsorted(t[start:], self._next))
            rows = slice(start, min(stop, t.size))
            for one in (self._old, self._new):
                one.update(t[rows], inputs[rows], outputs[rows], fresh[rows])
            start = rows.stop
            self._look(float(t[start - 1]))
        if start < t.size:
            self._new.update(t[start:], inputs[start:], outputs[start:], fresh[start:])

    def _look(self, time: float) -> None:
        """Let the old one go if the new one is ready."""
        if time < self._next:
            return
        self._next = time + LOOK
        found = self._new.estimate()
        ready = all(found[name][3] for name in self._known if name in found)
        if ready or time - self._begin >= LATEST:
            self._old = None

    @property
    def _speaker(self) -> Online:
        return self._old or self._new

    def estimate(self) -> Mapping[str, Estimate]:
        """Return the new estimator's parameters; as long as the old one speaks, with its values.

        What only the new model has comes from the new estimator.
        """
        found = self._new.estimate()
        if self._old is None:
            return found
        before = self._old.estimate()
        return {name: before.get(name, one) for name, one in found.items()}

    def prediction(self) -> Mapping[str, float]:
        """Return what was predicted for the last sample, by output."""
        return self._speaker.prediction()

    def residual(self) -> Mapping[str, float]:
        """Return measured minus predicted for the last sample, by output."""
        return self._speaker.residual()
