"""What data can tell of parameters at best: the Cramer-Rao bound, and what they do not tell."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SINGULAR = 1e-9
"""Eigenvalue of the scaled curvature below which a combination counts as unseen."""

_INVOLVED = 0.02
"""Share in an unseen combination, over the largest, below which a parameter has no part in it."""


@dataclass(frozen=True)
class Information:
    """Information of data on p parameters.

    Attributes
    ----------
    names:
        The parameters.
    rank:
        How many combinations of them the data see.
    condition:
        Of the curvature, its parameters scaled to one information each; infinite if one is unseen.
    bound:
        (p,) smallest standard deviation that an unbiased estimate can have (Cramer-Rao); infinite
        where the parameter is part of a combination that is unseen.
    covariance:
        (p, p) smallest covariance; its diagonal is `bound` squared where that is finite.
    unseen:
        (p - rank, p) unit vectors along which nothing in the data changes, in the coordinates of
        the columns.
    """

    names: tuple[str, ...]
    rank: int
    condition: float
    bound: Array
    covariance: Array
    unseen: Array

    def words(self) -> tuple[str, ...]:
        """Say what is not seen, and what helps."""
        return tuple(_words(self.names, one) for one in self.unseen)


def information(slopes: Array, names: Sequence[str], scale: Array | None = None) -> Information:
    """Return the information in sensitivities.

    Parameters
    ----------
    slopes:
        (N, p) derivatives of the outputs by the parameters, each over the standard deviation of
        the noise.
    names:
        The p parameters.
    scale:
        (p,) derivative of each parameter by its coordinate, where the columns are by coordinates
        (the value itself for a logarithm); one by default.
    """
    return of_curvature(slopes.T @ slopes, names, scale)


def of_curvature(
    curvature: Array, names: Sequence[str], scale: Array | None = None
) -> Information:
    """Return the information in a (p, p) matrix ``sum slope slope^T``; see `information`."""
    size = np.sqrt(np.maximum(np.diag(curvature), 1e-300))
    values, vectors = np.linalg.eigh(curvature / np.outer(size, size))
    dark = values < SINGULAR
    inverse = (vectors[:, ~dark] / values[~dark]) @ vectors[:, ~dark].T
    bound = np.sqrt(np.maximum(np.diag(inverse), 0.0)) / size
    hidden = vectors[:, dark]
    along = hidden / size[:, np.newaxis]
    unseen = along / np.maximum(np.linalg.norm(along, axis=0), 1e-300)
    for part in (hidden, unseen):
        strongest = np.max(np.abs(part), axis=0)
        bound[np.any(np.abs(part) > _INVOLVED * strongest, axis=1)] = np.inf
    condition = float('inf') if np.any(dark) else float(values[-1] / values[0])
    step = np.ones(size.size) if scale is None else np.abs(scale)
    covariance = inverse / np.outer(size, size) * np.outer(step, step)
    return Information(
        tuple(names), int(np.sum(~dark)), condition, bound * step, covariance, unseen.T
    )


def _words(names: Sequence[str], vector: Array) -> str:
    strongest = np.max(np.abs(vector))
    involved = [n for n, v in zip(names, vector, strict=True) if abs(v) > _INVOLVED * strongest]
    if len(involved) > 1:
        return f'these data see {", ".join(involved)} only in combination; fix one of them'
    return f'these data hold no information on {involved[0]}; fix it'
