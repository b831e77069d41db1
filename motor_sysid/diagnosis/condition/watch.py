"""Live estimates against a reference, look after look, for ever, at one stated false-alarm rate.

The n-th look may spend ``alpha 6 / (pi n)^2`` of the false-alarm rate: the sum over all looks is
`alpha`, however long the watch lasts and however much the looks have in common (Bonferroni;
Lan and DeMets, Biometrika 70, 1983, 659-663, call this spending).
"""

from collections.abc import Mapping
from dataclasses import dataclass
import math

from motor_sysid.diagnosis.condition.days import ALPHA, causes_of, in_words
from motor_sysid.diagnosis.condition.drift import alarms, Drift, drift_of_estimates, SCATTER
from motor_sysid.diagnosis.condition.likely import Likely
from motor_sysid.physics.model import Model


@dataclass(frozen=True)
class Look:
    """What one look says; see `motor_sysid.diagnosis.condition.days.Condition`."""

    number: int
    drift: Drift
    moved: tuple[int, ...]
    causes: tuple[Likely, ...]

    @property
    def words(self) -> str:
        """What has moved and why, in a sentence."""
        return in_words(self.drift, self.moved, self.causes)


class Watch:
    """Compares estimates with a reference from time to time.

    Parameters
    ----------
    reference:
        The model of the healthy motor, with sigmas.
    alpha:
        Chance of any false alarm, over all parameters and looks.
    scatter:
        Relative standard deviation of a healthy motor's parameters from day to day.
    """

    def __init__(
        self, reference: Model, alpha: float = ALPHA, scatter: float = SCATTER
    ) -> None:
        self._reference, self._alpha, self._scatter = reference, alpha, scatter
        self._looks = 0

    def look(self, estimates: Mapping[str, tuple[float, float, str, bool]]) -> Look:
        """Compare estimates: parameter to value, sigma, unit, and whether it is identifiable."""
        self._looks += 1
        spent = 6 * self._alpha / (math.pi * self._looks) ** 2
        drift = drift_of_estimates(self._reference, estimates, self._scatter)
        moved = alarms([drift], spent)[0]
        return Look(self._looks, drift, tuple(moved), causes_of(self._reference, drift, moved))
