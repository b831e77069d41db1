"""Read an effect from its file."""

import inspect
from types import ModuleType

from motor_sysid.errors import UserError
from motor_sysid.physics.effect import (
    Card,
    Effect,
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
    forces = (*FORCES, *(f'torque_{frame}' for frame in FRAMES))
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
    return Effect(key, card, laws, rates, inspect.getsource(module), speed_sum=summed)
