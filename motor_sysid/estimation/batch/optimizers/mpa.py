"""Marine predators: Brownian steps first, Levy steps last, and eddies in between.

With the best as the predator E, P = 0.5 and ``c = (1 - t)^(2 t)``:

- first third: ``x + P R B (E - B x)``, B Brownian;
- second: half of the prey ``x + P R L (E - L x)`` with Levy steps L, the others
  ``E + P c B (B E - x)``;
- last: ``E + P c L (L E - x)``.

After each move eddies carry prey off: with probability 0.2 over ``c`` times the box, in a fifth of
the coordinates, else along the difference of two others.  The better place stays.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.optimizers.base import Greedy, levy

Array = NDArray[np.float64]

_SHARE, _EDDIES, _FLIGHT = 0.5, 0.2, 0.05


class MarinePredators(Greedy):
    """Moves and eddies by turns."""

    title = 'marine predators'
    reference = 'Faramarzi et al. 2020, doi:10.1016/j.eswa.2020.113377'
    follows_shifts = False

    def __init__(
        self, dimension: int, population: int, iterations: int, rng: np.random.Generator
    ) -> None:
        super().__init__(dimension, population, iterations, rng)
        self._hunting = False

    def _trials(self) -> Array:
        late, self._hunting = self.progress, not self._hunting
        calm = (1 - late) ** (2 * late)
        return self._hunt(late, calm) if self._hunting else self._eddies(calm)

    def _hunt(self, late: float, calm: float) -> Array:
        x, best = self._members, self.best
        r = self._rng.random(x.shape)
        flight = _FLIGHT * levy(x.shape, self._rng)
        brown = self._rng.standard_normal(x.shape)
        if late < 1 / 3:
            first: Array = x + _SHARE * r * brown * (best - brown * x)
            return first
        if late < 2 / 3:
            explore = x + _SHARE * r * flight * (best - flight * x)
            exploit = best + _SHARE * calm * brown * (brown * best - x)
            half = np.arange(len(x))[:, np.newaxis] < len(x) // 2
            second: Array = np.where(half, explore, exploit)
            return second
        last: Array = best + _SHARE * calm * flight * (flight * best - x)
        return last

    def _eddies(self, calm: float) -> Array:
        x = self._members
        if self._rng.random() < _EDDIES:
            hit = self._rng.random(x.shape) < _EDDIES
            carried: Array = x + calm * hit * self._rng.uniform(-1, 1, x.shape)
            return carried
        r = self._rng.random()
        one, other = (x[self._rng.permutation(len(x))] for _ in range(2))
        drifted: Array = x + (_EDDIES * (1 - r) + r) * (one - other)
        return drifted
