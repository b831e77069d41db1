"""What is published as diagnostics, as plain values: estimates, fits, health."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
import math

from motor_sysid.estimation.stream import Event
from motor_sysid.nodes.live_diagnosis import DiagnosisOutcome
from motor_sysid.nodes.refit import RefitOutcome
from motor_sysid.physics.store import dump_model


@dataclass(frozen=True)
class Status:
    """One diagnostic status: what, how it is, in words, and its numbers."""

    name: str
    values: Mapping[str, object]
    message: str = 'ok'
    warn: bool = False


def under(node: str, statuses: Iterable[Status]) -> list[Status]:
    """Return statuses under the name of their node: in /diagnostics all nodes' come together."""
    return [replace(status, name=f'{node}: {status.name}') for status in statuses]


def text_of(value: object) -> str:
    """Return a value as text; a float so that it reads back bit for bit."""
    return repr(float(value)) if isinstance(value, float) else str(value)


def estimate_statuses(event: Event) -> list[Status]:
    """Return the statuses of ~/estimate: what went in, then one per parameter."""
    head = Status(
        'samples',
        {'samples': event.samples, 'first_stamp': event.first_stamp, 'digest': event.digest},
    )
    return [head, *(_parameter_status(name, e) for name, e in (event.estimate or {}).items())]


def _parameter_status(name: str, estimate: tuple[float, float, str, bool]) -> Status:
    value, sigma, unit, identifiable = estimate
    values: Mapping[str, object] = {
        'value': float(value), 'sigma': float(sigma), 'unit': unit, 'identifiable': identifiable,
    }  # fmt: skip
    if identifiable:
        return Status(name, values)
    return Status(name, values, 'not identifiable from the data so far', warn=True)


def fit_statuses(outcome: RefitOutcome) -> list[Status]:
    """Return the statuses of ~/model for a refit: how it went, then one per parameter."""
    values = {
        'success': outcome.success,
        'seconds': outcome.seconds,
        **{f'noise.{name}': float(rms) for name, rms in outcome.noise.items()},
        'model': dump_model(outcome.model),
    }
    head = Status('fit', values, outcome.reason, warn=not outcome.success)
    return [
        head,
        *(
            Status(
                p.name,
                {'value': p.value, 'sigma': p.sigma if p.sigma is not None else 0.0,
                 'unit': p.unit, 'free': p.free},
            )
            for p in outcome.model.parameters
        ),
    ]  # fmt: skip


def diagnosis_statuses(outcome: DiagnosisOutcome) -> list[Status]:
    """Return the statuses of ~/diagnosis: the verdict, the ladder, and one per candidate."""
    head: dict[str, object] = {
        'verdict': outcome.verdict,
        'effects': ', '.join(outcome.effects),
        'had': ', '.join(outcome.had),
        'first_stamp': outcome.first_stamp,
        'last_stamp': outcome.last_stamp,
        'held_until_stamp': '' if outcome.held_until is None else outcome.held_until,
        'noise_floor_percent': float(outcome.noise_floor_percent),
        'seconds': outcome.seconds,
        **{f'reason.{k}': text for k, text in enumerate(outcome.reasons, 1)},
        **{f'experiment.{name}': text for name, text in outcome.experiment.items()},
        **{f'warning.{k}': text for k, text in enumerate(outcome.warnings, 1)},
        'model': dump_model(outcome.rungs[-1].model),
    }
    return [
        Status('verdict', head, outcome.summary, warn=outcome.verdict != 'complete'),
        *_rung_statuses(outcome),
        *_candidate_statuses(outcome),
    ]


def diagnosis_summary(outcome: DiagnosisOutcome | None, running: bool) -> Status:
    """Return the line of /diagnostics about the last diagnosis."""
    name = 'diagnosis'
    if outcome is None:
        return Status(name, {'running': running}, 'none yet')
    values = {
        'running': running,
        'verdict': outcome.verdict,
        'effects': ', '.join(outcome.effects),
        'last_stamp': outcome.last_stamp,
        'reason': outcome.reasons[0] if outcome.reasons else '',
    }
    return Status(name, values, outcome.summary, warn=outcome.verdict != 'complete')


def _rung_statuses(outcome: DiagnosisOutcome) -> list[Status]:
    return [
        Status(
            f'step {k}',
            {
                'effects': ', '.join(rung.model.effects),
                'train_error_percent': float(rung.train_error_percent),
                'validation_error_percent': float(rung.validation_error_percent),
                **{
                    key: value
                    for p in rung.model.parameters
                    if p.free
                    for key, value in _numbers(p.name, p.value, p.sigma, p.unit).items()
                },
            },
        )
        for k, rung in enumerate(outcome.rungs)
    ]


def _candidate_statuses(outcome: DiagnosisOutcome) -> list[Status]:
    """Return one status per candidate."""
    statuses = []
    for one in outcome.candidates:
        values: dict[str, object] = {
            'delta_bic': float(one.delta_bic),
            'train_error_percent': float(one.train_error_percent),
            'validation_error_percent': float(one.validation_error_percent),
            'passes': one.passes,
            'confusable_with': ', '.join(one.confusable_with),
        }
        for name, (value, unit, sigma) in one.parameters.items():
            values |= _numbers(name, value, sigma, unit)
        statuses.append(Status(f'candidate {one.effect}', values, one.note or 'helps'))
    return statuses


def _numbers(name: str, value: float, sigma: float | None, unit: str) -> dict[str, object]:
    spread = math.nan if sigma is None else sigma
    return {f'{name}.value': float(value), f'{name}.sigma': float(spread), f'{name}.unit': unit}
