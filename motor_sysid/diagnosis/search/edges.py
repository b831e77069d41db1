"""Standard errors where a law ends within reach of the data.

A fit may end where few samples still lie beyond the end of a law.  These few make the other
parameters look known; a little further on nothing would be.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch import Problem, Weighting
from motor_sysid.estimation.batch.information import Information, of_curvature
from motor_sysid.estimation.batch.least_squares import normal_equations
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

LESS = 3.0
"""How many times less must be known of a parameter beyond an edge, so that this counts."""


def edges_of(model: Model) -> list[str]:
    """Return the free parameters at which a law of the model ends."""
    names = [f'{key}.{s.name}' for key in model.effects for s in effect(key).card.shapes if s.edge]
    return [name for name in names if model.parameters[name].free]


def beyond_edges(
    problem: Problem,
    weighting: Weighting,
    covariance: Array,
    sigma: Array,
    here: Information,
    edges: Sequence[str],
) -> Array:
    """Return standard errors (p,) that also hold one of them further on, past each edge.

    Parameters
    ----------
    problem, weighting:
        The fitted model with the data, and the noise model.
    covariance, sigma:
        (p, p) covariance and (p,) standard errors of its parameters.
    here:
        What the data tell at the fit.
    edges:
        Parameters at which a law ends.
    """
    names, z = list(here.names), problem.vector()
    slope, (lower, upper) = problem.slope(z), problem.box()
    wider = sigma.copy()
    for at in (names.index(name) for name in edges):
        if not np.isfinite(sigma[at]):
            continue
        along = covariance[:, at] / np.sqrt(covariance[at, at]) / slope
        for way in (along, -along):
            there = np.clip(z + way, lower, upper)
            curvature = normal_equations(problem.linearize(there), weighting)[1]
            if not np.all(np.isfinite(curvature)):
                continue
            beyond = of_curvature(curvature, names, problem.slope(there)).bound
            with np.errstate(invalid='ignore'):  # what is not seen here either is no less known
                less = beyond / here.bound
            wider = np.maximum(wider, np.where(less > LESS, less, 1.0) * sigma)
    return wider
