"""What a fit says."""

from collections.abc import Mapping
from dataclasses import dataclass
import re

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.information import Information
from motor_sysid.estimation.batch.weighting import Weighting
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FitResult:
    """A fitted model with its uncertainty.

    Attributes
    ----------
    model:
        The model with estimates and sigmas.
    success, reason:
        Whether the fit converged, and how it ended, in words.
    cost:
        Sum of squared weighted errors.
    weighting:
        Noise model that the errors were weighed with.
    noise:
        Output to RMS of its error over the scored data.
    residuals, predictions:
        For each scored stretch (N, n_y) measured minus simulated, and simulated.
    covariance:
        (p, p) covariance of the free parameters, in their units.
    unidentifiable:
        Combinations that the data do not determine, in words; empty when all is well.
    information:
        Rank, condition and Cramer-Rao bound of the free parameters.
    warnings:
        Parameters on their bounds and the like, each with its remedy.
    simulations, iterations:
        Effort.
    vector:
        (d,) solution in the coordinates of the problem.
    """

    model: Model
    success: bool
    reason: str
    cost: float
    weighting: Weighting
    noise: Mapping[str, float]
    residuals: tuple[Array, ...]
    predictions: tuple[Array, ...]
    covariance: Array
    unidentifiable: tuple[str, ...]
    information: Information
    warnings: tuple[str, ...]
    simulations: int
    iterations: int
    vector: Array

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Free parameters that `unidentifiable` speaks of."""
        said = {word for text in self.unidentifiable for word in re.split('[ ,;]+', text)}
        return tuple(p.name for p in self.model.parameters.free if p.name in said)
