"""An input that is written down a row late: the motor seems to answer before it is told.

What a drive reports is often what it applied up to the time of a row, or at that moment; a model
holds it from then on.  No physics acts before its cause, so this looks like an unknown effect.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from motor_sysid.diagnosis.result.result import Diagnosis, Verdict
from motor_sysid.diagnosis.search.bench import make_bench
from motor_sysid.diagnosis.search.rung import climb
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.base import Motor
from motor_sysid.signals.record import Record

REMAINS = 1.5
"""Held-out error, in units of what noise makes, from which on it is asked."""

HEALED = 0.5
"""Share of that error that must go."""

LEAST = 0.2
"""Rows by which an input must be early to be told."""

DELAY = 'input_delay'
"""The effect by which an input that is a row earlier is delayed again."""


@dataclass(frozen=True)
class Early:
    """How a model runs with an earlier input.

    Attributes
    ----------
    rows:
        By how many rows the motor is told earlier than is written, up to one.
    error_percent:
        Held-out error with that.
    """

    rows: float
    error_percent: float


def with_early_input(
    found: Diagnosis,
    fraction: float,
    nominal: Mapping[str, float],
    tell: Callable[[str], None],
) -> Diagnosis:
    """Return a diagnosis that says so where the model fails because its input is written late.

    It is asked where an error is left that nothing explains.

    Parameters
    ----------
    found:
        What was found.
    fraction:
        Share of each record that is held out where no whole ones are.
    nominal:
        Data-sheet values.
    tell:
        Is told what is going on.
    """
    step = found.steps[-1]
    model, error = step.model, step.validation_error_percent
    asked = found.verdict in (
        Verdict.UNKNOWN_EFFECT, Verdict.EFFECT_MISSING, Verdict.AMBIGUOUS,
    ) and error > REMAINS * found.noise_floor_percent  # fmt: skip
    late = any(effect(key).card.delay for key in model.effects)
    if not asked or late or not model.admits(effect(DELAY)):
        return found
    tell('asking whether the input is written down late')
    train, held = found.searched
    early = run_earlier(model, train, held, fraction, nominal, lent=found.lent)
    if early.rows < LEAST or not early.error_percent < HEALED * error:
        return found
    what = ' and '.join(input_signals(train[0], model.kind)).replace('_', ' ')
    said = (
        f'The data may be to blame: the motor answers {what} {early.rows:.2g} rows before that is '
        f'written; were it earlier by that, the held-out error would fall from {error:.3g} to '
        f'{early.error_percent:.3g} %. {_remedy(early.rows)}'
    )
    first = found.verdict is Verdict.UNKNOWN_EFFECT
    return replace(found, reasons=(said, *found.reasons) if first else (*found.reasons, said))


def run_earlier(
    model: Model,
    train: Sequence[Record],
    held: Sequence[Record],
    fraction: float,
    nominal: Mapping[str, float],
    *,
    lent: bool = False,
) -> Early:
    """Fit a model with an input that is a row earlier, and delayed again by what fits best."""
    fitted, kept = ([_sooner(r, model.kind) for r in records] for records in (train, held))
    bench = make_bench(fitted, kept, model.kind, model, fraction, nominal, lent=lent)
    dt = train[0].dt
    late = climb(model.with_effect(DELAY, {'delay': 0.5 * dt}, bench.scales), bench)
    return Early(1.0 - late.model[f'{DELAY}.delay'] / dt, late.validation.error_percent)


def _sooner(record: Record, kind: Motor) -> Record:
    """Return a record in which every row has the input of the next one."""
    names = input_signals(record, kind)
    moved = {name: np.append(record[name][1:], record[name][-1]) for name in names}
    return replace(record, signals={**record.signals, **moved})


def _remedy(rows: float) -> str:
    if rows > 1.0 - LEAST:
        return (
            'Its rows hold what was applied up to their time. To do: `shift: -1` of that column '
            'in a msg_config file'
        )
    return (
        'Its rows may hold what acted at that moment, or in the mean around it. To do: record the '
        'command; or `shift: -1` of that column in a msg_config file, and `input_delay`'
    )
