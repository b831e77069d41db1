"""What data tell of a model's parameters, and what an experiment would add (D-optimality).

The information of the recorded data and that of a simulated experiment add up; a vague prior, as
wide as the parameter's box makes sense, keeps both finite.  The criterion is the decrease of the
logarithm of the standard deviations of the parameters in question.
(Fedorov 1972; Goodwin and Payne 1977, chapter 6.)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.experiment.stage import Stage
from motor_sysid.estimation.batch import Problem
from motor_sysid.estimation.batch.least_squares import normal_equations
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

BOX_SHARE = 0.1
"""Prior standard deviation of a parameter with a sign, as a share of half its box."""

WIDE = 1e9
"""A box that is wider than this says nothing."""


@dataclass(frozen=True)
class Knowledge:
    """Information on the free parameters of a model.

    Attributes
    ----------
    problem:
        Whose coordinates are meant.
    data, prior:
        (d, d) information of the data and (d,) of the prior, in these coordinates.
    """

    problem: Problem
    data: Array
    prior: Array

    @property
    def covariance(self) -> Array:
        """Covariance (d, d) of the coordinates, prior included."""
        return inverse(self.data + np.diag(self.prior))

    def plus(self, information: Array) -> 'Knowledge':
        """Return what is known after an experiment of that information (d, d)."""
        return Knowledge(self.problem, self.data + information, self.prior)

    def sigma(self) -> Array:
        """Return (d,) standard deviations of the parameters in their units."""
        scale = np.abs(self.problem.slope(self.problem.vector()))
        return np.asarray(np.sqrt(np.diag(self.covariance)) * scale)

    def share_of_prior(self) -> Array:
        """Return (d,) standard deviations over those of the prior: 1 where data tell nothing."""
        return np.asarray(np.sqrt(np.diag(self.covariance) * self.prior))

    def loosest(self) -> tuple[Array, float]:
        """Return the direction (d,) that is known least and its standard deviation over the prior.

        Both in units of the prior: the direction has length 1 there.
        """
        width = 1 / np.sqrt(self.prior)
        values, vectors = np.linalg.eigh(self.covariance / np.outer(width, width))
        return vectors[:, -1] * width, float(np.sqrt(max(values[-1], 0.0)))


def inverse(information: Array) -> Array:
    """Return the inverse of a symmetric positive matrix, scaled to unit diagonal meanwhile."""
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = np.linalg.pinv(information / np.outer(size, size), rcond=1e-14, hermitian=True)
    return np.asarray(scaled / np.outer(size, size))


def known(stage: Stage, model: Model) -> Knowledge:
    """Return what the recorded data tell of a model."""
    problem = stage.problem(model, stage.records)
    return Knowledge(problem, information(stage, model, stage.records), prior(problem))


def information(stage: Stage, model: Model, records: Sequence[Record]) -> Array:
    """Return the information (d, d) of records on the coordinates of a model."""
    problem = stage.problem(model, records)
    near = problem.linearize(problem.vector())
    return normal_equations(near, stage.weighting)[1]


def prior(problem: Problem) -> Array:
    """Return (d,) information of the prior: a factor of e; the value, or a share of the box."""
    widths = []
    for p, size in zip(problem.free, problem.size.tolist(), strict=True):
        half = 0.5 * (p.upper - p.lower)
        reach = BOX_SHARE * half if half < WIDE else 0.0
        widths.append(1.0 if p.logarithmic else max(reach / size, 1.0))
    return np.asarray(np.array(widths) ** -2.0)
