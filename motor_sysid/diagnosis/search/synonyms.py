"""Effects that no record tells apart: one law under two names."""

from collections.abc import Collection

from motor_sysid.physics.effect import Effect
from motor_sysid.physics.effects import catalogue, effect
from motor_sysid.physics.model import Model

MOTION = {'omega', 'theta', 'turn', 'domega'}
"""What laws ask for that depend on the motion."""


def is_other_name(one: Effect, model: Model) -> bool:
    """Whether an effect that is another one under another name is that in this model, too.

    What a wrong zero of a sensor does is a load only where that sensor has a zero, nothing else
    depends on the motion and an offset of the current makes up for the rest.
    """
    names = {one.key, *one.card.sum_of}
    others = [model.effect(key) for key in model.effects if key not in names]
    known = any(p.name == 'current_offset' and not p.free for p in model.parameters)
    moving = any(other.needs() & MOTION for other in others)
    return model.admits(one) and not (model.kind.frame or known or moving)


def other_names(model: Model, rivals: Collection[str] = ()) -> list[str]:
    """Say what a model's effects may be called as well, beside the `rivals` that are told."""
    sums = [
        _same([effect(key).card.title for key in one.card.sum_of], one.card.title)
        for one in catalogue().values()
        if _is_there(one, model)
    ]
    alike = [
        f'{special.card.title} that is as gradual is the same law as {wide.card.title}: no '
        'record tells which of the two it is.'
        for wide in map(effect, model.effects)
        for special in map(effect, wide.card.generalises)
        if _is_another_cause(special, wide, model) and special.key not in rivals
    ]
    return sums + alike


def _is_another_cause(special: Effect, wide: Effect, model: Model) -> bool:
    """Whether a motor may have what a wider law has a special case of, from elsewhere.

    Brushes lose a voltage, and a bridge does; no brush is quite sharp at zero current either.
    """
    return special.card.enters is not wide.card.enters and model.admits(special)


def _is_there(one: Effect, model: Model) -> bool:
    """Whether a model holds an effect, or that under another name."""
    parts, there = set(one.card.sum_of), set(model.effects)
    if len(parts) == 1:
        return bool(there & {one.key, *parts}) and is_other_name(one, model)
    return bool(parts) and (parts <= there or one.key in there)


def _same(parts: list[str], title: str) -> str:
    are, alone = ('together are', '') if len(parts) > 1 else ('is', ' without the position')
    return (
        f'{" and ".join(parts)} {are} the same law as {title}: no record{alone} tells which of '
        'the two it is.'
    )
