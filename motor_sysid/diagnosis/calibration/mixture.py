"""Which sources of noise make a spectrum, and how strong: as few as the data ask for.

The sizes of given sources follow from non-negative least squares relative to the spectrum that
they make.  Sources are added one by one while Whittle's likelihood grows by more than the
extended BIC asks for, and dropped when later ones have taken over.  Free mixing would fit the
scatter of the lowest bands, and be wrong below them; a random force taken for errors of two
sensors would look like a missing effect, for the two would no longer agree with the equations;
and one that is not there makes evidence in every run of a bootstrap, so that the best of many
sources has to pay for having been chosen.
(Whittle 1953, doi:10.1007/BF02590998; Lawson and Hanson 1974; Chen and Chen 2008,
doi:10.1093/biomet/asn034.)
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]

_PASSES = 5
_LEAST = 1e-4


def parsimonious(seen: Array, known: Array, power: Array, counts: Array) -> Array:
    """Return the non-negative factors (k,) of the sources, most of them zero.

    Parameters
    ----------
    seen, known:
        (b,) spectrum of the errors, and what is known to be part of it.
    power:
        (b, k) spectra of the sources.
    counts:
        (b,) independent values of the periodogram in each band.
    """
    fit = _Fit(seen, known, power, counts)
    price = float(np.log(np.sum(counts)) + 2.0 * np.log(max(power.shape[1], 1)))
    chosen: tuple[int, ...] = ()
    while True:
        more = [(*chosen, k) for k in range(power.shape[1]) if k not in chosen]
        best = min(more, key=fit.deviance, default=chosen)
        if not fit.deviance(best) < fit.deviance(chosen) - price:
            break
        chosen = fit.without_superfluous(best, price)
    factors = np.zeros(power.shape[1])
    factors[list(chosen)] = fit.sizes(chosen)
    return factors


class _Fit:
    """Sizes and deviance of any choice of sources."""

    def __init__(self, seen: Array, known: Array, power: Array, counts: Array) -> None:
        self.seen, self.known, self.power, self.counts = seen, known, power, counts
        self._seen_before: dict[frozenset[int], float] = {}

    def sizes(self, chosen: tuple[int, ...]) -> Array:
        return _sizes(self.seen, self.known, self.power[:, list(chosen)], self.counts)

    def deviance(self, chosen: tuple[int, ...]) -> float:
        key = frozenset(chosen)
        if key not in self._seen_before:
            total = self.known + self.power[:, list(chosen)] @ self.sizes(chosen)
            self._seen_before[key] = _deviance(self.seen, total, self.counts)
        return self._seen_before[key]

    def without_superfluous(self, chosen: tuple[int, ...], price: float) -> tuple[int, ...]:
        """Drop earlier sources whose part a later one has taken over."""
        while len(chosen) > 1:
            less = [tuple(k for k in chosen if k != gone) for gone in chosen[:-1]]
            best = min(less, key=self.deviance)
            if self.deviance(best) > self.deviance(chosen) + price:
                break
            chosen = best
        return chosen


def _deviance(seen: Array, total: Array, counts: Array) -> float:
    """Return minus twice Whittle's log-likelihood of band means, up to a constant."""
    total = np.maximum(total, _LEAST * seen)
    return float(2.0 * np.sum(counts * (np.log(total) + seen / total)))


def _sizes(seen: Array, known: Array, power: Array, counts: Array) -> Array:
    """Return (k,) non-negative factors with which `power` (b, k) and `known` make `seen` (b,)."""
    scale, factors = seen, np.zeros(power.shape[1])
    if not factors.size:
        return factors  # `nnls` may bring the process down over a matrix without columns
    largest = np.maximum(power.max(axis=0), 1e-300)
    for _ in range(_PASSES):
        weights = np.sqrt(counts) / scale
        scaled = (power / largest) * weights[:, np.newaxis]
        factors = nnls(scaled, np.maximum(seen - known, 0.0) * weights)[0] / largest
        scale = np.maximum(known + power @ factors, 0.1 * seen)
    return factors
