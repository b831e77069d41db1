"""Refits and diagnoses of an identifier: when they are due, what goes in, what came out."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from motor_sysid.errors import UserError
from motor_sysid.estimation.stream import Event
from motor_sysid.nodes.configuration import Configuration
from motor_sysid.nodes.editing import present
from motor_sysid.nodes.identifier_settings import IdentifierSettings
from motor_sysid.nodes.jobs import Jobs
from motor_sysid.nodes.live_diagnosis import DiagnosisJob, DiagnosisOutcome
from motor_sysid.nodes.pipeline import Pipeline
from motor_sysid.nodes.refit import RefitJob, RefitOutcome
from motor_sysid.nodes.worker import Failed

SECOND = 1_000_000_000
REFIT, DIAGNOSIS = 'refit', 'diagnosis'


class Logger(Protocol):
    """Where failures are told."""

    def warning(self, message: str) -> object:
        """Tell."""


@dataclass(frozen=True)
class News:
    """Whether a refit or a diagnosis has come back since the last look."""

    fitted: bool = False
    diagnosed: bool = False


class LongWork:
    """The long work of one identifier.

    Parameters
    ----------
    logger:
        Is told what failed.
    effect_files:
        The user's own effects; see `Worker`.

    Attributes
    ----------
    fitted, diagnosis:
        The last refit and the last diagnosis; None before any.
    """

    def __init__(self, logger: Logger, effect_files: Sequence[str] = ()) -> None:
        self._logger, self._jobs = logger, Jobs(effect_files)
        self._due = dict.fromkeys((REFIT, DIAGNOSIS), 0)
        self._seen = 0
        self.fitted: RefitOutcome | None = None
        self.diagnosis: DiagnosisOutcome | None = None

    @property
    def diagnosing(self) -> bool:
        """Whether a diagnosis is on its way."""
        return self._jobs.running == DIAGNOSIS

    def start(self) -> None:
        """Start the process before there is work."""
        self._jobs.start()

    def close(self) -> None:
        """End it."""
        self._jobs.close()

    def reset(self) -> None:
        """Count periods anew: the samples begin anew."""
        self._due = dict.fromkeys(self._due, 0)

    def note(
        self, event: Event, pipeline: Pipeline, configuration: Configuration,
        settings: IdentifierSettings,
    ) -> None:  # fmt: skip
        """Ask for what is due by the sample time of an event; it may begin anew."""
        if event.stamp < self._seen:
            self.reset()
        self._seen = event.stamp
        periods = {REFIT: settings.refit_period, DIAGNOSIS: settings.diagnose_period}
        for kind, period in periods.items():
            full = event.stamp - event.first_stamp >= _window(kind, settings) * SECOND
            if period and full and event.stamp >= self._due[kind]:
                self._due[kind] = event.stamp + round(period * SECOND)
                self._jobs.ask(kind, partial(self._make, kind, pipeline, configuration, settings))

    def ask(
        self, kind: str, pipeline: Pipeline | None, configuration: Configuration,
        settings: IdentifierSettings,
    ) -> None:  # fmt: skip
        """Ask for a refit or a diagnosis now.

        Raises
        ------
        UserError
            If there are too few samples yet, or one of this kind is on its way.
        """
        seconds = _window(kind, settings)
        if pipeline is None or pipeline.record(seconds) is None:
            raise UserError(_too_few(seconds))
        make = partial(self._make, kind, pipeline, configuration, settings)
        if not self._jobs.ask(kind, make):
            raise UserError(f'a {kind} runs already')

    def _make(
        self, kind: str, pipeline: Pipeline, configuration: Configuration,
        settings: IdentifierSettings,
    ) -> RefitJob | DiagnosisJob | None:  # fmt: skip
        """Return the job on the samples at hand, or say why there is none."""
        job = _job(kind, pipeline, configuration, settings)
        if job is None:
            self._logger.warning(f'no {kind}: {_too_few(_window(kind, settings))}')
        return job

    def poll(self) -> News:
        """Take what came back, and start what waits."""
        done = self._jobs.poll()
        if done is None:
            return News()
        outcome = done.outcome
        if isinstance(outcome, Failed):
            kind = REFIT if isinstance(done.job, RefitJob) else DIAGNOSIS
            self._logger.warning(f'{kind} failed: {outcome.reason}')
        if isinstance(outcome, RefitOutcome):
            self.fitted = outcome
            return News(fitted=True)
        if isinstance(outcome, DiagnosisOutcome):
            self.diagnosis = outcome
            return News(diagnosed=True)
        return News()


def _window(kind: str, settings: IdentifierSettings) -> float:
    return settings.refit_window if kind == REFIT else settings.diagnose_window


def _too_few(seconds: float) -> str:
    return f'there are fewer than two samples in the last {seconds:g} s'


def _job(
    kind: str, pipeline: Pipeline, configuration: Configuration, settings: IdentifierSettings
) -> RefitJob | DiagnosisJob | None:
    """Return the job on the samples at hand; None if they are too few."""
    record = pipeline.record(_window(kind, settings))
    if record is None:
        return None
    if kind == REFIT:
        return RefitJob(configuration.model, record, settings.refit_method, settings.refit_seed)
    stream = pipeline.stream
    last = int(pipeline.window.last()[0][-1])
    first = last - round(record.duration * SECOND)
    offset = max((first - stream.first_stamp) / SECOND, 0.0) if stream.first_stamp >= 0 else 0.0
    model = present(configuration.model, stream.estimate())
    return DiagnosisJob(model, record, first, offset, settings.diagnose_alpha)
