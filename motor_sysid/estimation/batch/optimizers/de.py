"""Differential evolution: steps are differences of members.

A mutant is crossed with its parent, and the better of the two stays.  ``rand/1/exp`` takes
``x1 + F (x2 - x3)`` and copies one run of coordinates; ``current-to-best/1/bin`` takes
``x + F (best - x) + F (x1 - x2)`` and copies each coordinate with probability CR.
F = 0.5, CR = 0.9.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Greedy, others

Array = NDArray[np.float64]

F, CR = 0.5, 0.9


class RandomEvolution(Greedy):
    """Differences around a random member, exponential crossover (rand/1/exp)."""

    title = 'differential evolution, rand/1/exp'
    reference = 'Storn and Price 1997, doi:10.1023/A:1008202821328'

    def _trials(self) -> Array:
        a, b, c = (self._members[k] for k in others(len(self._members), 3, self._rng))
        copied = runs(self._members.shape, CR, self._rng)
        return np.where(copied, between(a + F * (b - c), self._members), self._members)


class BestEvolution(Greedy):
    """Differences on the way to the best, binomial crossover (current-to-best/1/bin)."""

    title = 'differential evolution, current-to-best/1/bin'
    reference = 'Storn and Price 1997, doi:10.1023/A:1008202821328'

    def _trials(self) -> Array:
        x = self._members
        a, b = (x[k] for k in others(len(x), 2, self._rng))
        copied = each(x.shape, np.full(len(x), CR), self._rng)
        mutant = x + F * (self.best - x) + F * (a - b)
        return np.where(copied, between(mutant, x), x)


def runs(shape: tuple[int, ...], rate: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return (P, d) which coordinates a run copies: one, and each next one while luck lasts."""
    count, d = shape
    lasting = np.cumprod(rng.random((count, d - 1)) < rate, axis=1)
    length = 1 + lasting.sum(axis=1)
    first = rng.integers(d, size=count)
    place = (np.arange(d) - first[:, np.newaxis]) % d
    copied: NDArray[np.bool_] = place < length[:, np.newaxis]
    return copied


def each(
    shape: tuple[int, ...], rates: Array, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Return (P, d) which coordinates are copied with (P,) probabilities; always one at least."""
    count, d = shape
    copied = rng.random(shape) < rates[:, np.newaxis]
    copied[np.arange(count), rng.integers(d, size=count)] = True
    return copied


def between(mutants: Array, parents: Array) -> Array:
    """Return mutants that left the cube half way between their parent and the wall."""
    low, high = 0.5 * (parents - 1.0), 0.5 * (parents + 1.0)
    return np.where(mutants < -1.0, low, np.where(mutants > 1.0, high, mutants))
