"""What an experiment decides, or why none would, in plain words."""

from collections.abc import Mapping, Sequence

import numpy as np

from motor_sysid.diagnosis.experiment.determine import Gain, NOTHING
from motor_sysid.diagnosis.experiment.discriminate import Found, Pair, SURE
from motor_sysid.diagnosis.experiment.information import Knowledge
from motor_sysid.diagnosis.experiment.limits import Limits
from motor_sysid.diagnosis.experiment.rivals import MOST, NONE
from motor_sysid.diagnosis.experiment.stage import Stage
from motor_sysid.diagnosis.result.names import listed
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

SAME = 2.0
"""Whitened distance below which two models are called the same: noise alone makes 1 for each
parameter."""

MATTERS = 0.02
"""Relative change of a parameter that is worth telling."""

LOOSE = 0.2
"""Share of a direction from which a parameter belongs to a combination."""


def names(models: Sequence[Model]) -> tuple[str, ...]:
    """Return a name for each rival: the keys of the effects that not all of them have."""
    shared = set.intersection(*(set(m.effects) for m in models))
    return tuple('+'.join(k for k in m.effects if k not in shared) or NONE for m in models)


def title(name: str) -> str:
    """Return the name of a rival for people."""
    if name == NONE:
        return 'the model as it is'
    return ' with '.join(effect(key).card.title for key in name.split('+'))


def separated(found: Found, rivals: Sequence[str]) -> str:
    """Say what an experiment decides and after how long."""
    least = min(found.pairs.values())
    return (
        f'{"separates" if len(rivals) == 2 else "tells"} {told_apart(rivals)}: expected dBIC '
        f'{least:.0f} after {found.tried.profile.duration:.3g} s'
    )


def not_separated(found: Found, rivals: Sequence[str]) -> str:
    """Say that nothing admissible separates the rivals."""
    (a, b), least = min(found.pairs.items(), key=lambda item: item[1])
    return (
        f'no admissible experiment separates {title(rivals[a])} from {title(rivals[b])}: the '
        f'best would bring a dBIC of {max(least, 0.0):.0f}, and {SURE:.0f} is asked for'
    )


def told_apart(rivals: Sequence[str]) -> str:
    """Return ``A from B``, or ``A, B and C apart``."""
    titles = [title(name) for name in rivals]
    return ' from '.join(titles) if len(titles) == 2 else f'{listed(titles)} apart'


def left_out(rivals: Sequence[str]) -> tuple[str, ...]:
    """Say which rivals were left out, if any were."""
    if not rivals:
        return ()
    verb, titles = 'is' if len(rivals) == 1 else 'are', listed(map(title, rivals))
    return (f'Left out {verb} {titles}: no more than {MOST} rivals are compared at once.',)


def doubts(found: Found, rivals: Sequence[str]) -> tuple[str, ...]:
    """Say for which pairs it may fail because the data leave something open."""
    return tuple(
        f'{title(rivals[a])} and {title(rivals[b])} may still look alike: the recorded data leave '
        f'parameters open, and at values that they allow the dBIC would be {max(value, 0.0):.0f}.'
        for (a, b), value in found.worst.items()
        if value < SURE
    )


def alike(stage: Stage, found: Found, rivals: Sequence[str]) -> tuple[str, ...]:
    """Say why two rivals look the same: what the one takes over from the other."""
    lines = []
    for pair, value in found.pairs.items():
        if value >= SURE:
            continue
        seen = min(
            (c for c in found.contrasts if {c.truth, c.rival} == set(pair)),
            key=lambda c: c.delta_bic,
        )
        moved = _moved(stage, seen.rival, seen.change)
        what = f'{title(rivals[seen.rival])} with {moved}' if moved else title(rivals[seen.rival])
        if seen.distance < SAME:
            lines.append(
                f'What {title(rivals[seen.truth])} does, {what} does as well, in every '
                'experiment tried: these two are one to the sensors.'
            )
        else:
            lines.append(f'Closest to {title(rivals[seen.truth])} comes {what}.')
    return tuple(lines)


def _moved(stage: Stage, place: int, change: np.ndarray) -> str:
    """Return how the parameters of a rival have to change, in percent or in their unit."""
    model = stage.models[place]
    problem = stage.problem(model, stage.records[:1])
    moved = []
    for p, size, step in zip(problem.free, problem.size.tolist(), change.tolist(), strict=True):
        if p.logarithmic and abs(step) > MATTERS:
            moved.append((abs(step), f'{p.name} {100 * float(np.expm1(step)):+.0f} %'))
        elif not p.logarithmic and abs(step * size) > MATTERS * max(abs(p.value), 1e-12):
            moved.append((abs(step), f'{p.name} = {p.value + step * size:.3g} {p.unit}'))
    return ', '.join(text for _, text in sorted(moved, reverse=True)[:5])


def more_time(pairs: Mapping[Pair, float], limits: Limits) -> tuple[str, ...]:
    """Say how much time would do, where evidence only needs to pile up."""
    least = min(pairs.values())
    if least < 1.0:
        return ()
    return (
        f'Evidence grows with time: about {limits.time * SURE / least:.0f} s of the same would '
        'do.',
    )


def sharpened(gain: Gain, names: Sequence[str]) -> str:
    """Say what an experiment tells of parameters and after how long."""
    problem, rows = gain.before.problem, list(gain.rows)
    before, after = gain.before.sigma()[rows], gain.after.sigma()[rows]
    parts = []
    for row, name, old, new in zip(rows, names, before.tolist(), after.tolist(), strict=True):
        p = problem.free[row]
        value = abs(p.value)
        if value > 0:
            parts.append(f'{name} from {spread(old / value)} to {spread(new / value)}')
        else:
            parts.append(f'{name} from {old:.2g} to {new:.2g} {p.unit}')
    return (
        f'narrows the standard deviation of {"; ".join(parts)} in '
        f'{gain.tried.profile.duration:.3g} s'
    )


def at_best(gain: Gain, names: Sequence[str]) -> str:
    """Say what the best experiment would bring all the same."""
    return f'The best one only {sharpened(gain, names)}; repeat it if that is worth the time.'


def spread(share: float) -> str:
    """Return a relative standard deviation in percent, or that it is unknown."""
    return 'unknown' if share > 1.0 else f'{100 * share:.2g} %'


def not_sharpened(gain: Gain, names: Sequence[str]) -> str:
    """Say that nothing admissible tells more of the parameters."""
    lost = gain.after.share_of_prior()[list(gain.rows)] >= NOTHING
    which = [name for name, none in zip(names, lost.tolist(), strict=True) if none] or names
    return f'no admissible experiment tells much more of {", ".join(which)}'


def combination(after: Knowledge) -> tuple[str, ...]:
    """Say which parameters remain seen in combination only."""
    direction, share = after.loosest()
    if share < NOTHING:
        return ()
    scaled = np.abs(direction) * np.sqrt(after.prior)
    involved = [
        p.name for p, part in zip(after.problem.free, scaled.tolist(), strict=True) if part > LOOSE
    ]
    if len(involved) < 2:
        return (f'Nothing that was tried shows {involved[0]}; measure it another way and fix it.',)
    return (
        f'{", ".join(involved)} are seen only in combination, whatever the motor is made to do: '
        'measure one of them another way and fix it.',
    )
