"""What can be tried on a fitted model: every effect, once for each choice of its shape."""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import product

import numpy as np

from motor_sysid.diagnosis.result.names import titles
from motor_sysid.physics.effect import Amplitude, Card, Effect, Shape
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.scales import Scales


@dataclass(frozen=True)
class Variant:
    """An effect with its shape chosen, ready to be tried on a model.

    Attributes
    ----------
    effect:
        The effect.
    values:
        Shapes, and the amplitude where a finite trial is made of it.
    model:
        The model with the effect, in which only the effect's amplitudes are free (none, for a
        finite trial).
    inherits:
        Whether it replaces an effect of the model.
    """

    effect: Effect
    values: Mapping[str, float]
    model: Model
    inherits: bool


def variants(
    model: Model,
    scales: Scales,
    effects: Sequence[Effect],
    proposed: Mapping[str, Sequence[float]],
) -> Iterator[Variant]:
    """Give every effect that can be added to the fitted model, once for each choice of its shape.

    `proposed` gives, by key, values worth trying for shapes that the data are searched for; see
    `motor_sysid.diagnosis.candidates.proposals`.  Effects that have no place are left out.
    """
    frozen = model.with_free([p.name for p in model.parameters.free], free=False)
    for one in map(model.kind.taking, effects):
        if refusal(model, one):
            continue
        pairs = [p for special, p in one.card.replaces.items() if special in model.effects]
        taken = {mine for some in pairs for mine, _ in some}
        inherits = bool(pairs)
        for values in _choices(one, scales, proposed.get(one.key, ()), taken):
            tried = frozen.with_effect(one.key, values, scales)
            fixed = [f'{one.key}.{name}' for name in (*values, *taken)]
            yield Variant(one, values, tried.with_free(fixed, free=False), inherits)


def refusal(model: Model, one: Effect) -> str:
    """Say why an effect has no place in a model, whatever the data say; nothing if it has one.

    A free parameter of the motor may do the same, or what the model has: a more general effect, or
    others of which it is the sum.
    """
    there = model.effects
    if one.key in there:
        return 'the model has it already'
    if not model.admits(one):
        return f'a {model.kind.title} recorded like this has no place for it'
    if not model.lacks(one):
        return f'{titles([one.after])} comes first'
    if wider := [key for key in there if one.key in effect(key).card.replaces]:
        return f'it is a special case of {titles(wider)}, which the model has'
    if len(one.card.sum_of) > 1 and set(one.card.sum_of) <= set(there):
        return f'it is the sum of {titles(one.card.sum_of)}, which the model has'
    if any(p.name == one.card.covers for p in model.parameters.free):
        return f'{one.card.covers} does the same, a parameter of the {model.kind.title}'
    return ''


def _choices(
    one: Effect, scales: Scales, proposed: Sequence[float], taken: Set[str]
) -> Iterator[dict[str, float]]:
    """Give values to all shapes but those that are `taken` over from what the model has."""
    grids: list[list[tuple[str, float]]] = []
    for card in one.card.parameters:
        size = scales.size(card.scale)
        if isinstance(card, Amplitude):
            if card.trials:
                tried = [t * size for t in card.trials]
                if one.filters_speed and card.name == one.card.filter:
                    tried = sorted({float(np.clip(t, *scales.speed_filter)) for t in tried})
                grids.append([(card.name, value) for value in tried])
        elif proposed and card.name in (one.card.orders, one.card.moment, one.card.frequency):
            grids.append([(card.name, float(value)) for value in proposed])
        elif isinstance(card, Shape) and card.name not in taken:
            grids.append([(card.name, s * size) for s in card.starts])
    for choice in product(*grids):
        yield dict(choice)


def shrunk(card: Card, base: Model, share: float, before: float = 0.0) -> dict[str, float]:
    """Return the parameters of `base` of which an effect takes a share, without it.

    A load of `share` times the motor's inertia leaves the motor that much less of what was fitted
    as one; `before`, if it had such a load already.
    """
    taken = [base.parameters[name] for name in card.shrinks if name in base.parameters]
    left = (1.0 + before) / (1.0 + share)
    return {p.name: float(np.clip(p.value * left, p.lower, p.upper)) for p in taken}
