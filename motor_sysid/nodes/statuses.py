"""What is published as diagnostics, as plain values: estimates, fits, health."""

from collections.abc import Mapping
from dataclasses import dataclass

from motor_sysid.estimation.stream import Event
from motor_sysid.nodes.refit import RefitOutcome
from motor_sysid.physics.store import dump_model


@dataclass(frozen=True)
class Status:
    """One diagnostic status: what, how it is, in words, and its numbers."""

    name: str
    values: Mapping[str, object]
    message: str = 'ok'
    warn: bool = False


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
    assert outcome.model is not None
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
