"""Which models are rivals: named by the user, or by a diagnosis; and their fits."""

from collections.abc import Callable, Iterable, Mapping, Sequence

from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.errors import UserError
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

NONE = 'none'
"""The rival that has no effect more than the model."""

MOST = 4
"""Most rivals that are compared at once."""

Sets = tuple[tuple[str, ...], ...]


def parse_rivals(texts: Sequence[str]) -> Sets:
    """Return sets of effects from texts such as ``coulomb_friction+constant_load_torque``.

    Raises
    ------
    UserError
        If an effect is unknown, or fewer than two rivals are named, or more than `MOST`.
    """
    sets = _distinct([k for k in text.split('+') if k != NONE] for text in texts)
    for key in {key for one in sets for key in one}:
        effect(key)
    if len(sets) < 2:
        raise UserError(
            f'rivals {", ".join(texts)}: name at least two that differ; `{NONE}` is the model as '
            'it is, and `+` joins effects that belong together'
        )
    if len(sets) > MOST:
        raise UserError(
            f'{len(sets)} rivals: {", ".join(texts)}; no more than {MOST} are compared at once: '
            'leave out those that are least likely'
        )
    return sets


def rivals_of(document: Mapping[str, object]) -> Sets:
    """Return the rivals that a diagnosis (its JSON document) names; empty if there are none.

    The first is what it would add, or the best of what it tried where it adds nothing; each
    further one has a confusable effect in its place.

    Raises
    ------
    UserError
        If it is no diagnosis.
    """
    chosen, candidates = document.get('effects'), document.get('candidates')
    if not isinstance(chosen, list) or not isinstance(candidates, list):
        raise UserError('no diagnosis: `effects` and `candidates` are missing')
    passing = [str(one.get('effect')) for one in candidates if one.get('passes')]
    first = tuple(str(key) for key in chosen or passing[:1])
    sets = [first]
    for one in candidates:
        key, others = str(one.get('effect')), one.get('confusable_with') or []
        if key in first:
            sets += [
                tuple(str(other) if k == key else k for k in first) for other in others
            ]
    distinct = _distinct(sets)
    return distinct if len(distinct) > 1 else ()


def _distinct(sets: Iterable[Sequence[str]]) -> Sets:
    """Return sets of effects, each once and with each effect once."""
    return tuple({frozenset(one): tuple(dict.fromkeys(one)) for one in sets}.values())


def fit_rivals(
    model: Model,
    sets: Sets,
    records: Sequence[Record],
    tell: Callable[[str], None] = lambda text: None,
) -> tuple[Model, ...]:
    """Fit every rival to the records: the model, with the rival's effects in place of the others'.

    An amplitude that the records do not tell, such as a friction in a direction in which nothing
    turned, is set to nothing: where the fit happened to leave it means nothing, and an experiment
    must not be promised to tell it from there.

    Raises
    ------
    UserError
        If an effect cannot be added to this model.
    """
    contested = {key for one in sets for key in one}
    slim = model
    for key in model.effects:
        if key in contested:
            slim = slim.without_effect(key)
    fitted = []
    for one in sets:
        tell(f'fitting the rival {" + ".join(one) or "without an effect more"}')
        fitted.append(_without_the_untold(fit_model(records, model=slim, effects=one).model, one))
        for key in one:
            if key not in fitted[-1].effects:
                raise UserError(_why_not(key, one))
    return tuple(fitted)


def _without_the_untold(model: Model, keys: Sequence[str]) -> Model:
    """Return a fitted model in which what no record tells of some effects is nothing."""
    own = [
        model.parameters[f'{key}.{a.name}']
        for key in keys if key in model.effects for a in effect(key).card.amplitudes
    ]  # fmt: skip
    untold = [p for p in own if p.free and p.sigma is not None and p.sigma > p.upper - p.lower]
    return model.with_values(model.parameters.inside({p.name: 0.0 for p in untold}))


def _why_not(key: str, others: Sequence[str]) -> str:
    if any(key in effect(other).card.replaces for other in others):
        return f'`{key}` is a special case of another effect of the rival; leave it out'
    return (
        f'`{key}` is no rival: in these data it would have a sign that physics forbids; leave it '
        'out, or give data that show it'
    )
