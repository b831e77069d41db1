"""Whether what a fit has made of an effect makes sense, however much it explains."""

from motor_sysid.physics.effect import Scale
from motor_sysid.physics.effects import effect
from motor_sysid.physics.laws import settling
from motor_sysid.physics.model import Model
from motor_sysid.physics.parameters import Parameter

TOLD = 2.0
"""Standard errors of the last fit, whose noise is taken as it is, that an amplitude must be from
zero: fewer, and its 95 % interval holds zero."""

LOWEST = 1.01
"""A shape lies on its lower bound up to this multiple of it."""

MOMENTS_APART = 100
"""Moments of a record that can be told apart: what matters lasts a hundredth of it."""


def vanished(model: Model, key: str) -> bool:
    """Whether a fit has taken an effect of one sign to nothing, or all that it widens.

    A rise of the friction near standstill without any friction that it rises over is no Stribeck
    friction.
    """
    card = effect(key).card
    own = {a.name: model.parameters[f'{key}.{a.name}'] for a in card.amplitudes if a.positive}
    none = {name for name, p in own.items() if p.value <= 1e-9 * p.upper}
    widened = [{mine for mine, _ in pairs} for pairs in card.generalises.values()]
    return any(names and names <= none for names in [set(own), *widened])


def senseless(model: Model, key: str, duration: float) -> str:
    """Return why what the shapes of an effect have come to makes no sense, or nothing.

    Times, speeds and angles are bounded by what the records show; a ratio by what it means, and on
    its upper bound it means nothing.  What comes back at a frequency must do so within the
    `duration` of a record, s, and what sets in, or comes to an end, must not have done so as it
    begins.
    """
    card = effect(key).card
    if card.moment and model[f'{key}.{card.moment}'] * MOMENTS_APART < duration:
        return 'is there from the start of a record on'
    if card.settles and is_lowest(model.parameters[f'{key}.{card.settles}']):
        return 'has come to its end as a record begins'
    if card.frequency and model[f'{key}.{card.frequency}'] * duration < 1.0:
        return 'swings less than once within a record'
    for shape in card.shapes:
        p = model.parameters[f'{key}.{shape.name}']
        if shape.scale is Scale.ONE and p.free and p.value >= 0.99 * p.upper:
            return f'{shape.name} ({shape.description}) is at the limit of what makes sense'
    return ''


def is_lowest(p: Parameter) -> bool:
    """Whether a fit has taken a parameter to its lower bound."""
    return p.free and p.value <= LOWEST * p.lower


def narrowed(model: Model, key: str) -> str:
    """Return the title of the special case that an effect has come to, or nothing.

    All that it adds to the special case is nothing: a friction that does not rise near standstill
    is Coulomb friction.
    """
    card = effect(key).card
    for special, pairs in card.generalises.items():
        taken = {mine for mine, _ in pairs}
        extra = [a for a in card.amplitudes if a.positive and a.name not in taken]
        added = [model.parameters[f'{key}.{a.name}'] for a in extra]
        if added and all(p.value <= 1e-9 * p.upper for p in added):
            return effect(special).card.title
    return ''


def is_vague(model: Model, key: str, special: str) -> bool:
    """Whether what an effect adds to a special case of it is not told from nothing."""
    card = effect(key).card
    taken = {mine for mine, _ in card.generalises[special]}
    extra = [model.parameters[f'{key}.{a.name}'] for a in card.amplitudes if a.name not in taken]
    return bool(extra) and all(abs(p.value) < TOLD * (p.sigma or 0.0) for p in extra)


def feeds(model: Model, key: str, duration: float) -> bool:
    """Whether an effect uses up a friction in `duration` s for certain, and feeds energy then."""
    card = effect(key).card
    lasting = settling(duration, model[f'{key}.{card.settles}']) if card.settles else duration
    for name, sources in card.drains.items():
        p = model.parameters[f'{key}.{name}']
        there = sum(model[source] for source in sources if source in model.parameters)
        if (p.value + TOLD * (p.sigma or 0.0)) * lasting < -there:
            return True
    return False


def is_impossible(model: Model, key: str, duration: float) -> bool:
    """Whether physics forbids what a fit has made of an effect, in a record of `duration` s."""
    return vanished(model, key) or feeds(model, key, duration)


def is_nonsense(model: Model, key: str, duration: float) -> bool:
    """Whether physics forbids what a fit has made of an effect, or it means something else."""
    return is_impossible(model, key, duration) or bool(senseless(model, key, duration))
