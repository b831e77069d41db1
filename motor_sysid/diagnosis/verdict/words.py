"""The verdict in plain words."""

from collections.abc import Mapping, Sequence

from motor_sysid.diagnosis.result.figures import apart, with_unit
from motor_sysid.diagnosis.result.findings import (
    BlindSpot,
    Evidence,
    Rivalry,
    Unknown,
    WrongParameter,
)
from motor_sysid.diagnosis.result.names import titles
from motor_sysid.diagnosis.result.result import Candidate, Step, Verdict
from motor_sysid.diagnosis.search.gates import UNSTEADY, WILD_PERCENT
from motor_sysid.diagnosis.search.synonyms import other_names
from motor_sysid.diagnosis.verdict.verdict import disagree, untold
from motor_sysid.diagnosis.where.other_values import OtherValues
from motor_sysid.diagnosis.where.remainder import (
    ABOVE_FLOOR,
    LARGE_PERCENT,
    Remainder,
    STRUCTURE,
    TRIFLE_PERCENT,
)
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

_CLEAR = 0.5
"""Share of a lacking force on one axis from which on that axis tells that it is no noise."""

_EXPERIMENTS = {
    'reversals': 'several constant speeds from very slow to fast, in both directions, 1 s each',
    'slow turn': 'at least five slow turns at constant speed, in both directions',
    'steps': 'voltage steps of several heights, 0.2 s apart, for 20 s',
    'long load': 'high and low load in turn for several thermal time constants',
}


def complete(step: Step, left: Remainder, spots: Sequence[BlindSpot]) -> list[str]:
    """Say that nothing is missing, and what these data could not have shown."""
    lines = [
        f'Nothing is missing that these data could show: the held-out error is '
        f'{step.validation_error_percent:.3g} %, sensor noise alone makes '
        f'{left.floor_percent:.3g} %.'
    ]
    lines += _remains(left)
    if left.floor_percent > LARGE_PERCENT:
        lines.append(
            'That is much for sensors: what swings or strikes within a few samples, as play does, '
            'looks like their noise. To do: sample faster, and record the motor at rest'
        )
    return [*lines, *(f'{spot.words} {_advice(spot)}' for spot in spots if spot.effects)]


def _remains(left: Remainder) -> list[str]:
    """Say what is above the sensor noise and no missing physics."""
    said = ''
    if left.above_floor and (left.uneven or left.predictable > STRUCTURE):
        said = f'is below {TRIFLE_PERCENT:g} % of the signal'
    elif left.above_floor:
        said = 'is not predictable from the input, as random load or drive ripple is'
    elif left.in_few:
        said = (
            'lies in one sample of a thousand, as a garbled message does, or what the drive does '
            'between two samples'
        )
    return [f'What remains above the sensor noise {said}.'] if said else []


def unknown(
    ladder: Sequence[Step], left: Remainder, found: Sequence[Unknown]
) -> list[str]:
    """Say that something unknown is missing, and on which axis it lives."""
    last = ladder[-1]
    torn = [
        c for c in last.candidates
        if disagree(
            c.note,
            last.validation_error_percent**2 - c.validation_error_percent**2,
            last.train_error_percent**2 - c.train_error_percent**2,
        )
    ]  # fmt: skip
    if torn and len(ladder) == 1 and not left.structured:
        return _contested(last, max(torn, key=lambda c: c.delta_bic))
    first, best = ladder[0].validation_error_percent, last.validation_error_percent
    sizes = [f'{first:.3g} %']
    sizes += [f'at best {best:.3g} % with what it holds'] * (best < first)
    sizes += [f'{_over_noise(left)} in one channel'] * bool(_over_noise(left))
    lines = [
        'Something is missing that the catalogue does not hold: the held-out error is '
        f'{", ".join(sizes)}, and {_structure(left, found)}.'
    ]
    spell = [str(left.spell)] if left.spell else []
    seen = shapes(found) if left.structured or found else []
    return [*lines, *spell, *seen, *_partial(ladder)]


def _contested(step: Step, found: Candidate) -> list[str]:
    """Say that training and held-out data do not agree on an effect."""
    title = effect(found.effect).card.title
    why = f'it {found.note}' if found.note == UNSTEADY else 'that is next to nothing there'
    return [
        f'Something is missing, but these data do not agree on what: {title} has overwhelming '
        f'evidence in the training data (a gain in BIC of {found.delta_bic:.0f}; the error falls '
        f'from {step.train_error_percent:.3g} to {found.train_error_percent:.3g} % there, from '
        f'{step.validation_error_percent:.3g} to {found.validation_error_percent:.3g} % over the '
        f'held-out data), yet {why}. To do: hold back data like those for training, '
        'with the position if there is an encoder',
    ]


def _structure(left: Remainder, found: Sequence[Unknown]) -> str:
    """Say what tells that what is left is no noise."""
    clear = next((one for one in found if one.axis and one.share > _CLEAR), None)
    if left.swing and left.swings:
        share, pace = 100 * left.swing.share, f'{left.swing.frequency:.3g} Hz'
        there = f'{left.training_percent:.3g} % error'
        return f'{share:.0f} % of it swings at {pace}, as in the training data ({there})'
    if left.other and left.moves and left.other.share > left.predictable:
        return _moved(left.other)
    if left.drifts and left.predictable < STRUCTURE:
        return f'{100 * left.drift:.0f} % of it in one record drifts: something came or went there'
    if left.uneven and left.predictable < STRUCTURE:
        return f'the model describes one record {left.unevenness:.2g} times worse than another'
    if left.predictable < STRUCTURE and clear:
        return f'{100 * clear.share:.0f} % of the {clear.quantity} follows the {clear.axis}'
    if left.predictable < STRUCTURE:
        return (
            'the motion hardly predicts any of it: loads that come and go, or what a drive does '
            'between two samples, look like that'
        )
    if left.short:
        return 'these data are too short to tell how much of it the motion predicts'
    said = f'the motion predicts {100 * left.predictable:.0f} % of the squared error of a channel'
    if left.waves:
        pace = ' and '.join(f'{n}' for n in left.waves)
        said += f': {pace} times a turn, a torque swings in proportion to the current'
    return said


def _moved(other: OtherValues) -> str:
    """Say which parameter the held-out data want otherwise, or that they want another input."""
    if other.by_gain:
        weaker = 'weaker' if other.gain < 1 else 'stronger'
        return (
            f'{100 * other.by_gain:.0f} % of its square would go if the input were '
            f'{100 * abs(other.gain - 1):.2g} % {weaker} there than recorded: a supply that '
            'differs from record to record, or from what a duty cycle is reckoned with, looks '
            'like that'
        )
    one = other.parameter
    value, now = (with_unit(v, one.unit, 2) for v in (other.value, one.value))
    most = f'{100 * other.alone:.0f} % with {one.name} about {value} instead of {now}'
    bound = value == now  # it would go further than makes sense
    return (
        f'{100 * other.share:.0f} % of its square would go with other values of the parameters '
        'there' + ('' if bound else f' ({most}, {one.description})') + ': what heats, saturates '
        'or wears looks like that'
    )


def shapes(found: Sequence[Unknown]) -> list[str]:
    """Say on which axis each equation's lack lives; one that is noise is not spoken of.

    Where two equations lack something on one axis, the clearer one is spoken of.
    """
    lines, axes = [], set()
    for one in found:
        if one.axis and one.axis in axes:
            continue
        axes.add(one.axis)
        if one.axis or one.rms > 1.2 * one.noise:
            lines.append(one.words)
    return lines or ['It shows on no axis of what is unexplained.']


def insufficient(
    names: Sequence[str], warnings: Sequence[str], spots: Sequence[BlindSpot]
) -> list[str]:
    """Say what the data do not determine, and what the excitation lacks."""
    what = f': {", ".join(names)}' if names else ''
    lines = [f'These data do not determine the motor{what}.']
    lines += [f'{spot.words} {_advice(spot)}' for spot in spots]
    told = {name for spot in spots for name in spot.parameters}
    rest = [name for name in names if name not in told]
    if rest and len(rest) < len(names):
        lines.append(f'{", ".join(rest)}: excite the motor more, with steps of random height.')
    if not spots:
        lines += [f'{warning[:1].upper()}{warning[1:]}.' for warning in warnings]
    return lines


def named(
    ladder: Sequence[Step],
    left: Remainder,
    evidence: Sequence[Evidence],
    rivalries: Sequence[Rivalry],
    found: Sequence[Unknown],
) -> list[str]:
    """Say what is missing, with its evidence."""
    first, last = ladder[0], ladder[-1]
    added = [k for k in last.model.effects if k not in first.model.effects]
    names = titles(added) or 'nothing'
    before, after = first.validation_error_percent, last.validation_error_percent
    was, now = apart(before, after)
    lines = [
        f'Missing: {names}. With {"them" if len(added) > 1 else "it"} the held-out error '
        f'{"falls" if after < before else "goes"} from {was} to {now} %; '
        f'sensor noise alone makes {left.floor_percent:.3g} %.'
    ]
    lines += [one.words for one in evidence]
    lines += [one.words for one in rivalries]
    lines += other_names(last.model, [one.rival for one in rivalries])
    if left.structured:
        lines.append(
            f'A smaller effect remains: {_still(left)}{_structure(left, found)}, but no effect of '
            'the catalogue explains it.'
        )
        lines += shapes(found)
    return lines if left.structured else lines + _remains(left)


def wrong(found: Sequence[WrongParameter]) -> list[str]:
    """Say which base parameters were wrong."""
    return [one.words for one in found]


def experiment(
    verdict: Verdict, rivals: Mapping[str, tuple[str, ...]]
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


def _partial(ladder: Sequence[Step]) -> list[str]:
    if len(ladder) < 2:
        return []
    last, start = ladder[-1], ladder[0].model.effects
    own = [key for key in last.model.effects if key not in start]
    names, error = titles(own), last.validation_error_percent
    if faint := untold(last.model, start):
        size = f'the size of {titles(faint)}' if len(own) > 1 else 'its size'
        return [
            f'{names} would lower the error most, but {size} cannot be told from nothing with '
            'these data: it may stand for something else.'
        ]
    if error > WILD_PERCENT:
        return [
            f'{names} would lower the error most, but a model that still errs by {error:.3g} % '
            'tells nothing of what it lacks.'
        ]
    held, fitted = (
        ' to '.join(apart(*pair)) for pair in (
            (ladder[0].validation_error_percent, error),
            (ladder[0].train_error_percent, last.train_error_percent),
        )
    )  # fmt: skip
    return [
        f'{names} would explain a part of it ({_sizes(last.model, own)}; held-out error '
        f'{held} %, training error {fitted} %), but not enough to be named: a wrong neighbour '
        'often looks like that.'
    ]


def _sizes(model: Model, keys: Sequence[str]) -> str:
    own = [
        model.parameters[f'{key}.{p.name}'] for key in keys for p in effect(key).card.parameters
        if p in effect(key).card.amplitudes or p.name == effect(key).card.orders
    ]  # fmt: skip
    return ', '.join(f'{p.name.partition(".")[2]} = {with_unit(p.value, p.unit)}' for p in own)


def _advice(spot: BlindSpot) -> str:
    return f'{spot.remedy[:1].upper()}{spot.remedy[1:]}.' if spot.remedy else ''


def _over_noise(left: Remainder) -> str:
    """Say how many times the sensor noise is left; nothing where that is about once."""
    if left.over_floor <= ABOVE_FLOOR:
        return ''
    often = f'{left.over_floor:.1f}' if left.over_floor < 100 else 'more than a hundred'
    return f'{often} times the sensor noise'


def _still(left: Remainder) -> str:
    return f'the error is still {_over_noise(left)} and ' if _over_noise(left) else ''
