"""How errors are weighed: the size of each channel's noise, and its colour."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Weighting:
    """Noise model of the outputs.

    Attributes
    ----------
    sigma:
        (n_y,) standard deviation of each output's (whitened) error.
    whiteners:
        For each output the coefficients (order + 1,) of the filter that whitens its error, the
        first one 1; empty for white errors.
    """

    sigma: Array
    whiteners: tuple[Array, ...] = field(default=())

    @property
    def order(self) -> int:
        """Samples that are lost at the start of a stretch."""
        return max((w.size - 1 for w in self.whiteners), default=0)

    def flat(self, values: Array) -> Array:
        """Whiten and weigh (N, n_y, k) along time; return ((N - order) n_y, k)."""
        if self.whiteners:
            one = np.ones(1)
            parts = [lfilter(w, one, values[:, j], axis=0) for j, w in enumerate(self.whiteners)]
            values = np.stack(parts, axis=1)[self.order :]
        weighed: Array = (values / self.sigma[:, np.newaxis]).reshape(-1, values.shape[2])
        return weighed

    def basis(self, directions: Array) -> Array:
        """Return an orthonormal basis of weighed (N, n_y, m) directions, (K, m)."""
        q, _ = np.linalg.qr(self.flat(directions))
        return q

    def removed(self, values: Array, directions: Array) -> Array:
        """Weigh (N, n_y, k) and take out what the (N, n_y, m) directions explain."""
        flat = self.flat(values)
        if directions.shape[2] == 0:
            return flat
        q = self.basis(directions)
        rest: Array = flat - q @ (q.T @ flat)
        return rest


def white(errors: Sequence[Array], floor: Array | float = 1e-12) -> Weighting:
    """Return the weighting of white errors of the size of (N, n_y) arrays, at least `floor`."""
    joined = np.concatenate(list(errors))
    return Weighting(np.maximum(np.sqrt(np.mean(joined**2, axis=0)), floor))


def coloured(errors: Sequence[Array], order: int, floor: Array | float = 1e-12) -> Weighting:
    """Fit an autoregressive noise model of that order to each column of (N, n_y) errors.

    Yule-Walker, pooled over the stretches; the estimate is stable by construction.
    """
    whiteners, sigmas = [], []
    for j in range(errors[0].shape[1]):
        covariance = np.zeros(order + 1)
        count = 0
        for error in errors:
            e = error[:, j] - np.mean(error[:, j])
            count += e.size
            covariance += [float(e[: e.size - k] @ e[k:]) for k in range(order + 1)]
        covariance = covariance / count
        covariance[0] = covariance[0] * (1 + 1e-9) + 1e-30
        ar = solve_toeplitz(covariance[:-1], covariance[1:])
        whiteners.append(np.concatenate(([1.0], -ar)))
        sigmas.append(np.sqrt(max(covariance[0] - ar @ covariance[1:], 1e-30)))
    return Weighting(np.maximum(np.array(sigmas), floor), tuple(whiteners))
