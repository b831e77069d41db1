"""Random disturbances of a motor and its sensors: coloured forces, coloured errors, rounding."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Source:
    """Gaussian noise with an exponential memory (Ornstein and Uhlenbeck).

    Attributes
    ----------
    place:
        Signal whose sensor errs, or equation of the motor (``torque``, ``voltage``) that is
        disturbed.
    force:
        Whether `place` is an equation.
    memory:
        Correlation time, s; 0: white.
    sigma:
        Standard deviation, in the unit of the place.
    """

    place: str
    force: bool
    memory: float
    sigma: float = 1.0

    def draw(self, count: int, dt: float, rng: np.random.Generator) -> Array:
        """Return (count,) values."""
        white = self.sigma * rng.standard_normal(count)
        if self.memory == 0.0:
            return white
        keep = math.exp(-dt / self.memory)
        fresh = math.sqrt(1.0 - keep**2)
        white[0] /= fresh  # the process is stationary from its first value
        return np.asarray(lfilter([fresh], [1.0, -keep], white), dtype=np.float64)


@dataclass(frozen=True)
class Noise:
    """Everything random about a recording.

    Attributes
    ----------
    sources:
        Independent disturbances.
    steps:
        Signal to the step that it is rounded to; signals without one are not rounded.
    counted:
        Whether speed is the exact difference of the rounded position.
    mismatch_db:
        RMS over frequency bands of what the spectrum of the fitted model's errors and that of
        simulated ones differ by, dB.
    """

    sources: tuple[Source, ...] = ()
    steps: Mapping[str, float] = field(default_factory=dict)
    counted: bool = False
    mismatch_db: float = float('nan')

    def only(self, sources: Sequence[Source], *, rounded: bool) -> 'Noise':
        """Return it with other sources, and with or without its rounding."""
        return replace(self, sources=tuple(sources), steps=self.steps if rounded else {})

    def errors(self, count: int, dt: float, rng: np.random.Generator) -> dict[str, Array]:
        """Draw the (count,) errors of the sensors."""
        return self._drawn(False, count, dt, rng)

    def forces(self, count: int, dt: float, rng: np.random.Generator) -> dict[str, Array]:
        """Draw the (count + 1,) disturbing forces, from the first sample to after the last."""
        return self._drawn(True, count + 1, dt, rng)

    def _drawn(
        self, force: bool, count: int, dt: float, rng: np.random.Generator
    ) -> dict[str, Array]:
        total: dict[str, Array] = {}
        for one in self.sources:
            if one.force == force:
                values = one.draw(count, dt, rng)
                total[one.place] = total[one.place] + values if one.place in total else values
        return total

    @property
    def words(self) -> tuple[str, ...]:
        """Its parts, in words."""
        parts = [
            f'{"process " if one.force else ""}{one.place} noise {one.sigma:.3g}'
            + (f' with a memory of {1e3 * one.memory:.3g} ms' if one.memory else ', white')
            for one in self.sources
        ]
        parts += [f'{signal} in steps of {step:.4g}' for signal, step in self.steps.items()]
        return tuple(parts)


def rounded(values: Array, step: float) -> Array:
    """Round (N,) values to whole steps; 0 leaves them as they are."""
    return step * np.round(values / step) if step else values
