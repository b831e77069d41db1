"""A refit of the model to the last samples, as a job for the worker."""

from dataclasses import dataclass
import time

from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record


@dataclass(frozen=True)
class RefitOutcome:
    """What came of a refit.

    Attributes
    ----------
    model:
        The fitted model with sigmas.
    success, reason:
        Whether it converged, and how it ended.
    noise:
        Output to RMS of what the fit leaves.
    seconds:
        Time taken.
    """

    model: Model
    success: bool
    reason: str
    noise: dict[str, float]
    seconds: float


@dataclass(frozen=True)
class RefitJob:
    """What to fit: a model on a record, by which method, from which seed."""

    model: Model
    record: Record
    method: str
    seed: int

    def work(self) -> RefitOutcome:
        """Fit; see `motor_sysid.estimation.batch.refit`."""
        from motor_sysid.estimation.batch import refit

        begin = time.perf_counter()
        result = refit(self.model, self.record, method=self.method, seed=self.seed)
        seconds = time.perf_counter() - begin
        return RefitOutcome(
            result.model, result.success, result.reason, dict(result.noise), seconds
        )
