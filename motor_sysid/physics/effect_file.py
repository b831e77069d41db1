"""Read an effect from its file."""

from dataclasses import replace
import functools
import inspect
import re
from types import ModuleType

import numpy as np

from motor_sysid.errors import UserError
from motor_sysid.physics.effect import (
    arguments,
    Card,
    DRIVEN,
    Effect,
    Enters,
    FORCES,
    FRAMES,
    JUMPS,
    Law,
    REDUCED,
    SECOND,
    SENSORS,
    SHORTFALLS,
    SUM,
)
from motor_sysid.signals.units import did_you_mean

_SAMPLES = np.array([0.5, -0.25, 3.0, 0.0])


def load_effect(key: str, module: ModuleType) -> Effect:
    """Read an effect from its module.

    Raises
    ------
    UserError
        If the module has no ``CARD`` or no law, or if an own state has no rate.
    """
    card = getattr(module, 'CARD', None)
    where = getattr(module, '__file__', key)
    if not isinstance(card, Card):
        raise UserError(f'effect file {where} defines no CARD; see docs/effects.md')
    if unknown := set(card.hidden_by) - set(SHORTFALLS):
        raise UserError(
            f'effect file {where}: hidden_by names `{min(unknown)}`; '
            f'it may name {", ".join(SHORTFALLS)}'
        )
    forces = (*FORCES, *(f'torque_{frame}' for frame in (*FRAMES, DRIVEN)))
    known = (*forces, REDUCED, *(SECOND + name for name in forces), *SENSORS, *JUMPS)
    laws = {name: getattr(module, name) for name in known if hasattr(module, name)}
    if not laws and not card.delay:
        raise UserError(f'effect file {where} defines no law; write torque(...) or voltage(...)')
    rates: dict[str, Law] = {}
    for state in card.states:
        for frame in ('', *FRAMES):
            tail = f'_{frame}' if frame else ''
            rate = getattr(module, f'rate_{state}{tail}', getattr(module, f'rate{tail}', None))
            if rate is not None:
                rates[f'{state}{tail}'] = rate
        if state not in rates:
            raise UserError(f'effect file {where}: state `{state}` has no rate_{state}(...)')
    summed = getattr(module, SUM, None)
    told = vars(module)
    starts = {s: told[f'start_{s}'] for s in card.states if f'start_{s}' in told}
    doubts = {n.removeprefix('doubt_'): told[n] for n in told if n.startswith('doubt_')}
    source = inspect.getsource(module)
    return Effect(key, card, laws, rates, source, '', summed, starts, doubts)


def checked(one: Effect) -> Effect:
    """Return a user's effect, if it can be worked with.

    Raises
    ------
    UserError
        If its card or one of its laws does not hold what the others rely on.
    """
    if problem := _problem(one):
        raise UserError(f'effect `{one.key}`: {problem}; see docs/effects.md')
    return replace(
        one,
        laws={name: over_arrays(law) for name, law in one.laws.items()},
        rates={name: over_arrays(rate) for name, rate in one.rates.items()},
        speed_sum=one.speed_sum and over_arrays(one.speed_sum),
        starts={name: over_arrays(start) for name, start in one.starts.items()},
        doubts={name: over_arrays(doubt) for name, doubt in one.doubts.items()},
    )


def over_arrays(law: Law) -> Law:
    """Return a law that takes numbers and arrays.

    One that is written for a sample, with a branch or a function of `math` in it, is called for
    one after the other; the compiled one is not concerned.
    """
    asked = arguments(law)
    try:
        with np.errstate(all='ignore'):
            whole = np.broadcast_to(law(*(_SAMPLES for _ in asked)), _SAMPLES.shape)
            each = [law(*(x for _ in asked)) for x in _SAMPLES]
        if np.allclose(whole, each, rtol=1e-9, atol=0.0, equal_nan=True):
            return law
    except Exception:  # noqa: BLE001 - whatever a law for numbers raises of arrays
        pass
    one_by_one = np.vectorize(law, otypes=[np.float64])

    @functools.wraps(law)
    def called(*given: float) -> float:
        found: float = one_by_one(*given) if asked else law()
        return found

    return called


def _problem(one: Effect) -> str:
    """Return what is wrong with an effect, or nothing."""
    card, names = one.card, [p.name for p in one.card.parameters]
    twice = next((name for name in names if names.count(name) > 1), '')
    laws = {**one.laws, **one.rates}
    laws |= {f'start_{name}': law for name, law in one.starts.items()}
    laws |= {f'doubt_{name}': law for name, law in one.doubts.items()}
    broken = next((name for name, law in laws.items() if not callable(law)), '')
    enters: object = card.enters
    if not re.fullmatch(r'[\w-]+', one.key):
        return 'a key has letters, digits, `_` and `-` only; rename it'
    if not isinstance(enters, Enters):
        return f'`enters` is {enters!r}; give one of Enters'
    if not card.amplitudes:
        return 'the card has no amplitude that would switch it off'
    if twice:
        return f'two parameters are called `{twice}`'
    if broken:
        return f'`{broken}` is no function'
    read = {name for law in laws.values() for name in arguments(law)} | {card.delay}
    shapes = [shape.name for shape in card.shapes]
    named = (card.orders, card.moment, card.frequency, card.settles, card.pace)
    if stray := next((name for name in named if name and name not in shapes), ''):
        return f'the card names `{stray}`, which is none of its shapes'
    if unread := [name for name in names if name not in read]:
        return f'no law reads its parameter `{unread[0]}`'
    if foreign := sorted(read - {*names, *card.states, *_known_to_motors()} - {''}):
        near = did_you_mean(foreign[0], {*names, *card.states, *_known_to_motors()})
        return f'a law asks for `{foreign[0]}`, which no motor has{near}'
    if blank := _not_proposed(one):
        return f'its laws let no data propose values of `{blank}`; give it starts'
    return next(filter(None, (_fault(name, law) for name, law in laws.items())), '')


def _known_to_motors() -> set[str]:
    """Return all that a law may ask some motor for."""
    from motor_sysid.physics.motors import motors

    return {name for kind in motors().values() for name in kind.names()}


def _not_proposed(one: Effect) -> str:
    """Return the shape that the data are to propose and cannot, if there is one.

    They tell a frequency by what acts on an equation, and the others by such a law that asks for
    no state of the effect's own.
    """
    card = one.card
    acting = [law for name, law in one.laws.items() if name not in (*SENSORS, *JUMPS)]
    plain = [law for law in acting if not set(arguments(law)) & set(card.states)]
    asked = ((card.orders, plain), (card.moment, plain), (card.frequency, acting))
    started = {shape.name for shape in card.shapes if shape.starts}
    return next((name for name, laws in asked if name not in {'', *started} and not laws), '')


def _fault(name: str, law: Law) -> str:
    """Return what happens when a law is called, or nothing if that is a number."""
    try:
        value = law(*(0.5 for _ in arguments(law)))
        float(value)
    except Exception as error:  # noqa: BLE001 - whatever a user's law raises
        return f'`{name}(...)` fails: {type(error).__name__}: {error}'
    return ''
