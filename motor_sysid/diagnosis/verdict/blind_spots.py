"""What the excitation does not show, and which parameters and effects cannot be seen for it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
import re

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.figures import with_unit
from motor_sysid.diagnosis.result.findings import BlindSpot
from motor_sysid.diagnosis.result.names import listed
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.model import Model
from motor_sysid.signals.checks import excitation
from motor_sysid.signals.finding import Severity
from motor_sysid.signals.record import Record

VAGUE = 0.7
"""Relative standard deviation above which a positive parameter counts as undetermined."""

SELDOM = 0.005
"""Share of the time in which a motor must turn slowly for its friction there to be seen."""

ELECTRICAL = 1.0
"""Samples in an electrical time constant below which the inductance cannot be seen."""

HELD = 0.05
"""Spread of an input over its size up to which it is one value, with some noise."""

_FASTER = 10.0
"""How much faster to sample where it cannot: by how much is not known either."""


_PARAMETERS: Mapping[str, tuple[str, ...]] = {
    'constant_input': ('R', 'L', 'k_t', 'J', 'b', 'k_v', 'k_a'),
    'no_motion': ('k_t', 'J', 'b', 'k_v', 'k_a'),
    'one_direction': ('b', 'current_offset'),
    'few_speeds': ('b', 'k_v'),
    'mostly_at_rest': ('J', 'b', 'k_a'),
    'short_travel': (),
    'never_slow': (),
    'no_current': ('R', 'L', 'k_t'),
    'slow_sampling': ('L',),
    'begins_driven': (),
}
"""Shortfall to the base parameters that may be lost with it; what effects it hides, their cards
tell."""

_ALIKE = ('constant_input', 'one_direction', 'few_speeds')
"""Shortfalls that do not hide effects, but mix them up."""


@dataclass(frozen=True)
class _Found:
    """A shortfall of the excitation."""

    code: str
    words: str
    remedy: str


def blind_spots(
    model: Model,
    records: Sequence[Record],
    warnings: Sequence[str],
    seen: Sequence[str] = (),
) -> tuple[BlindSpot, ...]:
    """Return what the excitation does not show.

    Parameters
    ----------
    model:
        The fitted base model with its standard deviations.
    records:
        What was recorded.
    warnings:
        What the fit says about parameters that it cannot determine.
    seen:
        Effects that were found: these data do show them.
    """
    vague = undetermined(model, warnings)
    known = {
        key: one for key, one in catalogue().items() if key not in seen and _sensible(model, key)
    }
    spots = []
    for found in (*_from_checks(records), *_from_model(model, records, vague)):
        lost = _PARAMETERS[found.code]
        parameters = tuple(n for n in lost if n in vague or found.code == 'no_current')
        effects = tuple(
            key for key, one in known.items()
            if found.code in one.card.hidden_by
            and model.admits(one) != (found.code == 'no_current')
        )  # fmt: skip
        tail = _consequence(parameters, effects, alike=found.code in _ALIKE)
        spots.append(
            BlindSpot(found.code, parameters, effects, f'{found.words}{tail}.', found.remedy)
        )
    return tuple(spots)


def input_is_constant(records: Sequence[Record]) -> bool:
    """Whether the input never changes, so that one state of the motor is seen and no more."""
    return any(
        finding.code == 'constant_input' and finding.severity is Severity.ERROR
        for finding in excitation.check(records)
    )


def undetermined(model: Model, warnings: Sequence[str]) -> tuple[str, ...]:
    """Return the free base parameters that the data do not determine."""
    asides = model.kind.unless_given
    free = [p for p in model.parameters.free if '.' not in p.name and p.name not in asides]
    text = ' '.join(w for w in warnings if 'these data' in w)
    return tuple(
        p.name
        for p in free
        if (p.logarithmic and p.sigma is not None and not p.sigma < VAGUE * p.value)
        or re.search(rf'\b{re.escape(p.name)}\b', text)
    )


def _sensible(model: Model, key: str) -> bool:
    one = catalogue()[key]
    return key not in model.effects and not one.after and (
        model.admits(one) or 'i' not in model.kind.states
    )  # fmt: skip


def _from_checks(records: Sequence[Record]) -> Iterator[_Found]:
    """Take over what the data doctor says of the excitation."""
    for finding in excitation.check(records):
        if finding.code in _PARAMETERS:
            yield _Found(finding.code, _capital(finding.message), finding.remedy)
        if finding.code == 'excitation' and finding.numbers['share_slow'] < SELDOM:
            share = finding.numbers['share_slow'] * 100
            yield _Found(
                'never_slow',
                f'The motor turns slowly (at 2 to 10 % of its top speed) for {share:.1g} % of the '
                'time only',
                'add slow motion: ramps through zero, or constant low speeds in both directions',
            )


def _from_model(
    model: Model, records: Sequence[Record], vague: Sequence[str]
) -> Iterator[_Found]:
    if 'i' not in model.kind.states and 'voltage' in input_signals(records[0], model.kind):
        yield _Found(
            'no_current',
            'No current is measured: friction and inertia are seen in volts',
            'record the motor current, too',
        )
    driven = [record[n] for record in records for n in input_signals(record, model.kind)]
    if all(_is_held(values[1:]) for values in driven):
        yield _Found(
            'begins_driven',
            'No record shows the input before it was switched on, nor a change of it',
            'begin the record some samples before the step',
        )
    names = {p.name for p in model.parameters}
    if {'R', 'L'} <= names:
        dt = float(np.median([r.dt for r in records]))
        constant = model['L'] / model['R']
        if constant < ELECTRICAL * dt and 'L' in vague:
            yield _Found(
                'slow_sampling',
                f'A sample every {with_unit(dt, "s")} is longer than the electrical time constant',
                f'sample faster, at {with_unit(_FASTER / dt, "Hz")} or more',
            )


def _is_held(values: NDArray[np.float64]) -> bool:
    return bool(np.std(values) <= HELD * np.sqrt(np.mean(values**2)))


def _consequence(parameters: Sequence[str], effects: Sequence[str], *, alike: bool) -> str:
    parts = []
    if parameters:
        verb = 'is' if len(parameters) == 1 else 'are'
        parts.append(f'{listed(parameters)} {verb} not determined')
    if effects:
        titles = [catalogue()[key].card.title for key in effects]
        parts.append(
            f'{listed(titles)} cannot be told apart' if alike and len(titles) > 1
            else f'{listed(titles)} cannot be seen'
        )  # fmt: skip
    return f', so {" and ".join(parts)}' if parts else ''


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
