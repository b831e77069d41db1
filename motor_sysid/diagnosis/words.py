"""The verdict in plain words."""

from collections.abc import Mapping, Sequence
import itertools

from motor_sysid.diagnosis.refit import parameters_of
from motor_sysid.diagnosis.remainder import Remainder
from motor_sysid.diagnosis.result import Candidate, Step, Verdict
from motor_sysid.physics.effects import effect

_EXPERIMENTS = {
    'reversals': 'several constant speeds from very slow to fast, in both directions, 1 s each',
    'slow turn': 'at least five slow turns at constant speed, in both directions',
    'steps': 'voltage steps of several heights, 0.2 s apart, for 20 s',
    'long load': 'high and low load in turn for several thermal time constants',
}


def reasons(
    verdict: Verdict,
    steps: Sequence[Step],
    left: Remainder,
    rivals: Mapping[str, tuple[str, ...]],
) -> tuple[str, ...]:
    """Say what was found, most important first."""
    first, last = steps[0], steps[-1]
    if verdict is Verdict.COMPLETE:
        lines = [
            f'Nothing is missing that these data could show: the held-out error is '
            f'{first.validation_error_percent:.3g} %, sensor noise alone makes '
            f'{left.floor_percent:.3g} %.'
        ]
        if left.over_floor > 1.3:
            lines.append(
                'What remains above the sensor noise is not predictable from the input, as random '
                'load or drive ripple is.'
            )
    elif verdict is Verdict.UNKNOWN_EFFECT:
        lines = [
            f'Something is missing that the catalogue does not hold: the held-out error is '
            f'{last.validation_error_percent:.3g} %, {_times(left.over_floor)} the sensor '
            f'noise in one channel, and {100 * left.predictable:.0f} % of it is predictable from '
            'the motion.',
            'The maps of the unexplained torque and voltage show on which axis it lives.',
        ]
        lines += _partial(steps)
    elif verdict is Verdict.INSUFFICIENT_DATA:
        lines = ['These data do not determine the motor: excite it more.']
    else:
        lines = _named(steps, left, rivals)
    lines += _wrong_parameters(first, last) if verdict is Verdict.EFFECT_MISSING else []
    return tuple(lines)


def _named(
    steps: Sequence[Step], left: Remainder, rivals: Mapping[str, tuple[str, ...]]
) -> list[str]:
    first, last = steps[0], steps[-1]
    names = ' and '.join(effect(k).card.title for k in last.model.effects) or 'nothing'
    lines = [
        f'Missing: {names}. With it the held-out error falls from '
        f'{first.validation_error_percent:.3g} to {last.validation_error_percent:.3g} %; '
        f'sensor noise alone makes {left.floor_percent:.3g} %.'
    ]
    for step, after in itertools.pairwise(steps):
        added = next((k for k in after.model.effects if k not in step.model.effects), '')
        found = next((c for c in step.candidates if c.effect == added), None)
        if found is not None:
            lines.append(_evidence(found, step, last))
    for key, others in rivals.items():
        if others:
            lines.append(
                f'{effect(key).card.title} cannot be told from '
                f'{" or ".join(effect(o).card.title for o in others)} with these data.'
            )
    if left.over_floor > 1.3 and left.predictable > 0.25:
        lines.append(
            f'A smaller effect remains: the error is still {_times(left.over_floor)} the sensor '
            f'noise and {100 * left.predictable:.0f} % of it is predictable from the motion, but '
            'no effect of the catalogue explains it.'
        )
    return lines


def _evidence(found: Candidate, before: Step, last: Step) -> str:
    final = parameters_of(last.model, found.effect) or found.parameters
    values = ', '.join(
        f'{name} = {value:.4g} ± {sigma:.1g} {unit}'
        for name, (value, unit, sigma) in final.items()
    )
    return (
        f'{found.title} ({values}): evidence dBIC {found.delta_bic:.3g}, held-out error '
        f'{before.validation_error_percent:.3g} to {found.validation_error_percent:.3g} %.'
    )


def _partial(steps: Sequence[Step]) -> list[str]:
    if len(steps) < 2:
        return []
    names = ' and '.join(effect(k).card.title for k in steps[-1].model.effects)
    return [
        f'{names} would explain a part of it, but not enough to be named: a wrong neighbour often '
        'looks like that.'
    ]


def _wrong_parameters(first: Step, last: Step) -> list[str]:
    """Say which base parameters were wrong because of what was missing."""
    shared = {name for key in last.model.effects for name in effect(key).card.shrinks}
    lines = []
    for p in last.model.parameters.free:
        if '.' in p.name or not p.logarithmic or p.name in shared:
            continue
        ratio = first.model[p.name] / p.value
        if ratio > 1.15 or ratio < 1 / 1.15:
            size = f'{max(ratio, 1 / ratio):.2g} times too {"large" if ratio > 1 else "small"}'
            lines.append(f'Without it, {p.name} ({p.description}) was {size}.')
    return lines


def experiment(
    verdict: Verdict, steps: Sequence[Step], rivals: Mapping[str, tuple[str, ...]]
) -> dict[str, str] | None:
    """Say what to record next, if that would decide something."""
    if verdict is Verdict.INSUFFICIENT_DATA:
        return {'profile': _EXPERIMENTS['steps'], 'purpose': 'to determine the base parameters'}
    if verdict is Verdict.AMBIGUOUS:
        key = next(k for k, others in rivals.items() if others)
        axis = effect(key).card.axis
        profile = {'position': 'slow turn', 'time': 'long load'}.get(axis, 'reversals')
        names = ' from '.join((key, *rivals[key][:1]))
        return {'profile': _EXPERIMENTS[profile], 'purpose': f'to tell {names}'}
    return None


def _times(ratio: float) -> str:
    return f'{ratio:.1f} times' if ratio < 100 else 'more than a hundred times'
