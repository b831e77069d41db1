"""What speaks for the effects that were added, and what was wrong without them."""

from collections.abc import Iterator, Mapping, Sequence
import itertools
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.figures import apart, with_unit
from motor_sysid.diagnosis.result.findings import Evidence, WrongParameter
from motor_sysid.diagnosis.result.result import Candidate, Step
from motor_sysid.diagnosis.search.gates import WILD_PERCENT
from motor_sysid.diagnosis.search.refit import parameters_of
from motor_sysid.diagnosis.search.speed_sensors import is_filtered
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.effect import Amplitude
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import linear_unit, Model
from motor_sysid.signals.lateness import speed_lateness
from motor_sysid.signals.record import Record

INTERVAL = 1.96
"""Standard deviations on either side of a 95 % interval."""

_DIGITS, _MOST_DIGITS = 3, 7
"""Digits of a value; more only so that the ends of its interval differ."""

CERTAIN, WORTH = 3.0, 0.1
"""A parameter was wrong if it moved by so many standard deviations, and by that share."""

AT_NOISE = 1.02
"""Error over sensor noise below which shares of what is beyond it mean nothing."""

RATED = 'rated_torque'
"""Name of the rated torque among nominal values."""

LARGE = 1.0
"""Share of the torque or voltage at hand above which one that is lost is not plausible."""


def evidence_of(
    ladder: Sequence[Step],
    records: Sequence[Record],
    floor_percent: float,
    nominal: Mapping[str, float],
) -> tuple[Evidence, ...]:
    """Return what speaks for each effect of the last model, in the order of adding."""
    last = ladder[-1]
    found: list[Evidence] = []
    for step, after in itertools.pairwise(ladder):
        for key in after.model.effects:
            candidate = next((c for c in step.candidates if c.effect == key), None)
            if key in step.model.effects or key not in last.model.effects:
                continue
            if candidate is not None and all(one.effect != key for one in found):
                found.append(_evidence(candidate, step, after, last, records, floor_percent,
                                       nominal))  # fmt: skip
    return tuple(found)


def wrong_parameters(first: Step, last: Step) -> tuple[WrongParameter, ...]:
    """Return the base parameters that moved beyond doubt, the most wrong first.

    A parameter that an added effect shares (an inertia of which a part now hangs on a spring) was
    not wrong.  A first model that explains next to nothing of the data that it was fitted to says
    nothing of any parameter.
    """
    if first.train_error_percent > WILD_PERCENT:
        return ()
    shared = _shared(last.model)
    moved = [
        wrong
        for p in last.model.parameters.free
        if '.' not in p.name and p.name not in shared and p.name in first.model.parameters
        for wrong in _moved(first.model, last.model, p.name)
    ]
    moved.sort(key=lambda w: -abs(math.log(w.factor)) if w.factor > 0 else 0.0)
    return tuple(moved)


def _shared(model: Model) -> set[str]:
    """Return the base parameters of which a part is an effect's."""
    return {name for key in model.effects for name in effect(key).card.shrinks}


def off_nominal(model: Model, nominal: Mapping[str, float]) -> list[str]:
    """Say which base parameters are far from their nominal values.

    One of which a part is an effect's (an inertia that hangs on a spring) is not what a data sheet
    means.
    """
    lines, shared = [], _shared(model)
    for p in model.parameters.free:
        value = nominal.get(p.name, 0.0)
        if '.' in p.name or p.name in {'b', *shared}:
            continue
        if value > 0 and p.value > 0:
            ratio = p.value / value
            if abs(math.log(ratio)) > math.log(1.5) and _known(p.sigma, p.value):
                lines.append(
                    f'{p.name} ({p.description}) is {_times(ratio)} its nominal value '
                    f'({with_unit(p.value, p.unit)} against {with_unit(value, p.unit)}).'
                )
    return lines


def _evidence(
    found: Candidate,
    before: Step,
    after: Step,
    last: Step,
    records: Sequence[Record],
    floor: float,
    nominal: Mapping[str, float],
) -> Evidence:
    parameters = {
        name: (value, unit, sigma, value - INTERVAL * sigma, value + INTERVAL * sigma)
        for name, (value, unit, sigma) in parameters_of(last.model, found.effect).items()
    }
    old, new = before.validation_error_percent, after.validation_error_percent
    beyond = max(old**2 - floor**2, 1e-12 * old**2, 1e-300)
    share = 100 * float(np.clip((old**2 - new**2) / beyond, 0.0, 1.0))
    gain = 100 * (1 - new / old) if old > 0 else 0.0
    plausible, why = _plausible(found.effect, last.model, records, nominal)
    taken = f'it takes away {share:.0f} % of the squared error beyond sensor noise'
    if old < AT_NOISE * floor:
        taken = 'the error was at the sensor noise already'
    falls = f'{taken}, and the held-out error falls' if gain >= 0 else 'the held-out error rises'
    later = '' if gain >= 0 or after is last else ', and falls with what was found beside it'
    words = (
        f'{found.title} ({_values(parameters)}): evidence dBIC {found.delta_bic:.3g}; {falls} '
        f'by {_share(abs(gain))} % ({" to ".join(apart(old, new))} %){later}.'
        f'{why and f" {why}"}'
    )
    return Evidence(found.effect, found.title, found.delta_bic, share, gain, parameters,
                    plausible, why, words)  # fmt: skip


def _share(percent: float) -> str:
    return f'{percent:.0f}' if percent >= 10 else f'{percent:.2g}'


def _values(parameters: Mapping[str, tuple[float, str, float, float, float]]) -> str:
    parts = []
    for name, (value, unit, sigma, low, high) in parameters.items():
        if sigma > 0 and math.isfinite(sigma):
            ends = max(abs(low), abs(high))
            digits = min(max(_DIGITS, 1 + math.ceil(math.log10(ends / sigma))), _MOST_DIGITS)
            shown, least, most = (with_unit(one, unit, digits) for one in (value, low, high))
            parts.append(f'{name} = {shown}, 95 %: {least} to {most}')
        else:
            parts.append(f'{name} = {with_unit(value, unit)}')
    return '; '.join(parts)


def _plausible(
    key: str, model: Model, records: Sequence[Record], nominal: Mapping[str, float]
) -> tuple[bool, str]:
    """Judge sign and size of an effect's amplitudes."""
    if shown := _shown(key, records):
        return True, shown
    lines, fine = [], True
    for card in effect(key).card.amplitudes:
        p = model.parameters[f'{key}.{card.name}']
        if card.positive and p.sigma == math.inf:
            lines.append(f'These data see {card.name} only in combination with other parameters.')
        elif card.positive:
            sure = _known(p.sigma, p.value) and p.value > 0
            vague = [] if sure else _unknown_shapes(key, model)
            fine = fine and (sure or bool(vague))
            lines.append(
                'Its sign is the one that physics demands.' if sure
                else f'These data tell {card.name} only together with {", ".join(vague)}.'
                if vague
                else f'{card.name} cannot be told from zero.'
            )  # fmt: skip
        lines += list(_size(card, abs(p.value), model, records, nominal))
    fine = fine and not any('more than' in line for line in lines)
    return fine, ' '.join(dict.fromkeys(lines))


def _shown(key: str, records: Sequence[Record]) -> str:
    """Say what a position tells of a filter of the speed; nothing of anything else."""
    late = speed_lateness(records) if effect(key).filters_speed else None
    if late is None or not is_filtered(late, records[0].dt):
        return ''
    return (
        f'The position shows it, whatever the motor does: {with_unit(late.seconds, "s", 3)} from '
        'the motion to the speed that is shown.'
    )


def _unknown_shapes(key: str, model: Model) -> list[str]:
    """Return the free shapes of an effect that may be nothing: with them goes its amplitude."""
    free = [(s.name, model.parameters[f'{key}.{s.name}']) for s in effect(key).card.shapes]
    return [name for name, p in free if p.free and not _known(p.sigma, p.value)]


def _size(
    card: Amplitude,
    value: float,
    model: Model,
    records: Sequence[Record],
    nominal: Mapping[str, float],
) -> Iterator[str]:
    """Compare a torque, force or voltage with the rated or the largest one at hand."""
    whole, name = _whole(card.unit, model, records, nominal)
    if whole <= 0:
        return
    share = value / whole
    yield (
        f'{card.name} is {100 * share:.2g} % of {name}.' if share <= LARGE
        else f'{card.name} is {share:.2g} times {name}: the motor can swing it, not hold it.'
        if card.swings
        else f'{card.name} is more than {name}: hardly plausible.'
    )  # fmt: skip


def _whole(
    unit: str, model: Model, records: Sequence[Record], nominal: Mapping[str, float]
) -> tuple[float, str]:
    """Return what there is of a torque or voltage, and what that is called; 0 of other things."""
    kind = model.kind
    if unit == 'V':
        volts = [r[n] for r in records for n in input_signals(r, kind) if r.units[n] == 'V']
        return _largest(volts), 'the largest voltage'
    if unit != 'N m' or all(f.name != 'torque' or f.unit != unit for f in kind.forces):
        return 0.0, ''
    word = 'force' if linear_unit(unit) == 'N' and model.linear else 'torque'
    if RATED in nominal:
        return nominal[RATED], f'the rated {word}'
    drive = [kind.drive_torque(model.parameters.values(), r) for r in records]
    return _largest(drive), f'the largest {word}'


def _largest(parts: Sequence[NDArray[np.float64]]) -> float:
    """Return the largest size, but for one in a thousand."""
    return float(np.quantile(np.abs(np.concatenate(parts)), 0.999)) if parts else 0.0


def _moved(first: Model, last: Model, name: str) -> Iterator[WrongParameter]:
    old, new = first.parameters[name], last.parameters[name]
    spread = math.hypot(old.sigma or 0.0, new.sigma or 0.0)
    size = max(abs(old.value), abs(new.value))
    change = abs(old.value - new.value)
    if not math.isfinite(spread) or change <= CERTAIN * spread or change < WORTH * size:
        return
    which, was = f'Without it, {name} ({new.description})', with_unit(old.value, new.unit)
    factor = math.nan
    if new.logarithmic and new.on_bound and new.value < old.value:
        words = f'{which} came out as {was}; with it, it is too small for these data to show.'
    elif not new.logarithmic:
        words = f'{which} came out as {was} instead of {with_unit(new.value, new.unit)}.'
    else:
        factor = old.value / new.value
        words = (
            f'{which} was {_times(max(factor, 1 / factor))} too '
            f'{"large" if factor > 1 else "small"}: {old.value:.3g} -> {new.value:.3g} {new.unit}.'
        )
    yield WrongParameter(
        name, new.description, new.unit, old.value, new.value, old.sigma or 0.0,
        new.sigma or 0.0, factor, words,
    )  # fmt: skip


def _known(sigma: float | None, value: float) -> bool:
    return sigma is not None and math.isfinite(sigma) and abs(value) > 2 * sigma


def _times(ratio: float) -> str:
    return f'{ratio:.2g} times' if ratio < 99.5 else 'more than a hundred times'
