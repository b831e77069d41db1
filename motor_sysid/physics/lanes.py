"""Compile a law into a lane function for eight parameter vectors, called by address.

The kernel knows no effect.  Each law is written, together with the whole text of its file, into a
generated module whose name holds a hash of everything that it depends on, and is compiled alone;
so any combination of effects is only a list of addresses, an edited law is never stale, and a
user's own file takes the same path as a built-in one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
import hashlib
import importlib.util
import inspect
import os
from pathlib import Path
import sys
from threading import Lock
from types import ModuleType

import numba
from numba.core.errors import NumbaError
import numpy as np

from motor_sysid.errors import UserError
from motor_sysid.machine_code import cache_directory
from motor_sysid.physics import laws, native, rotor_frame, vector
from motor_sysid.physics.effect import (
    ARGUMENTS,
    arguments,
    Effect,
    FORCES,
    JUMPS,
    Law,
    SECOND,
    SENSORS,
    SUM,
)

LANES = native.LANES
"""Parameter vectors in one block."""

SHARED = (laws, rotor_frame, native, vector)
"""Modules whose functions laws and lanes call: an edit of theirs makes every lane anew."""

ROW_OF_ARGUMENT = {name: row for row, name in enumerate(ARGUMENTS)}
_TARGETS = (*FORCES, *SENSORS, *JUMPS, SUM)
ROW_OF_FORCE = {name: len(ARGUMENTS) + row for row, name in enumerate(_TARGETS)}
FIRST_PARAMETER_ROW = len(ARGUMENTS) + len(ROW_OF_FORCE)

_TEMPLATE = """

# ---- generated from the effect {origin}; do not edit ----
from numba import cfunc as _cfunc, njit as _njit
from motor_sysid.physics.native import as_pointer as _as_pointer
from motor_sysid.physics.vector import get as _get, put as _put, WIDTH as _WIDTH

_law = _njit(error_model='numpy', forceinline=True)({function})


@_cfunc('void(int64, int64, int64)', cache=True, error_model='numpy')
def lane(base, own, state):
    p = _as_pointer(base)
"""

_AT_ONCE = ('_get(p, {})', '    _put(p, {target}, _get(p, {target}) + _law({arguments}))\n')
_ONE_BY_ONE = (
    'p[{} + _k]', '    for _k in range(_WIDTH):\n        p[{target} + _k] += _law({arguments})\n'
)  # fmt: skip
"""How an argument is read and a law is called, for eight parameter vectors and for one."""


@dataclass(frozen=True)
class Lane:
    """A compiled law.

    Attributes
    ----------
    address:
        Of the native function ``void(buffer, own parameter offset, own state offset)``.
    target:
        Name of the equation, or of the own state whose rate it gives.
    arguments:
        Names that it reads.
    own_state:
        Whether the target is an own state.
    keep:
        The compiled object, which must outlive the address.
    """

    address: int
    target: str
    arguments: frozenset[str]
    own_state: bool
    keep: object


def compile_effect(effect: Effect, motor_parameters: tuple[str, ...]) -> tuple[Lane, ...]:
    """Compile every law and rate of an effect for a motor with the given parameters, once.

    Threads that ask for the same at the same time wait for the first of them.

    Raises
    ------
    UserError
        If a law asks for a name that the motor and the effect do not have.
    """
    with _COMPILING:
        return _compile(effect.key, effect.source, motor_parameters, _Laws(effect))


_COMPILING = Lock()


class _Laws:
    """The laws of an effect, equal when their source is: so that compilation is memoized."""

    def __init__(self, effect: Effect) -> None:
        self.effect = effect
        named = (*all_laws(effect).items(), *effect.rates.items())
        self.identity = (effect.source, tuple((name, law.__name__) for name, law in named))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Laws) and other.identity == self.identity

    def __hash__(self) -> int:
        return hash(self.identity)


def all_laws(effect: Effect) -> dict[str, Law]:
    """Return target to law, that of the summed speed among them."""
    return {**effect.laws, **({SUM: effect.speed_sum} if effect.speed_sum else {})}


@cache
def _compile(
    key: str, source: str, motor_parameters: tuple[str, ...], holder: _Laws
) -> tuple[Lane, ...]:
    effect = holder.effect
    lanes = [
        _lane(effect, law, target, f'{ROW_OF_FORCE[target] * LANES}', motor_parameters)
        for name, law in all_laws(effect).items()
        for target in [name.removeprefix(SECOND)]
    ]
    count = len(effect.card.states)
    for index, (state, rate) in enumerate(effect.rates.items()):
        target = f'state + {(count + index) * LANES}'
        lanes.append(_lane(effect, rate, state, target, motor_parameters))
    return tuple(lanes)


def _lane(
    effect: Effect, law: Law, name: str, target: str, motor_parameters: tuple[str, ...]
) -> Lane:
    names = arguments(law)
    places = [_place(effect, name, motor_parameters) for name in names]
    module = _compiled(f'{effect.key}_{name}', effect.source, {
        'origin': effect.key, 'function': law.__name__, 'target': target
    }, places)  # fmt: skip
    lane = module.lane
    return Lane(int(lane.address), name, frozenset(names), name in effect.card.states, lane)


def _compiled(
    stem: str, source: str, names: Mapping[str, str], places: Sequence[str]
) -> ModuleType:
    """Return the module of a law; one that vectors do not go through is called for each number.

    That is one with a branch in it, or a function that vectors do not know.
    """
    texts = []
    for read, call in (_AT_ONCE, _ONE_BY_ONE):
        values = ', '.join(map(read.format, places))
        texts.append(source + (_TEMPLATE + call).format(arguments=values, **names))
    if not _path_of(f'{stem}_each', texts[1]).exists():
        try:
            return _generated_module(stem, texts[0])
        except NumbaError:
            pass
    return _generated_module(f'{stem}_each', texts[1])


def _place(effect: Effect, name: str, motor_parameters: tuple[str, ...]) -> str:
    """Return the expression of where one argument of a law lies in the buffer."""
    own = [p.name for p in effect.card.parameters]
    if name in own:
        return f'own + {own.index(name) * LANES}'
    if name in effect.card.states:
        return f'state + {effect.card.states.index(name) * LANES}'
    if name in ROW_OF_ARGUMENT:
        return f'{ROW_OF_ARGUMENT[name] * LANES}'
    if name in ROW_OF_FORCE:
        return f'{ROW_OF_FORCE[name] * LANES}'
    if name in motor_parameters:
        return f'{(FIRST_PARAMETER_ROW + motor_parameters.index(name)) * LANES}'
    known = ', '.join([*own, *effect.card.states, *motor_parameters, *ARGUMENTS])
    raise UserError(f'effect `{effect.key}`: law asks for unknown `{name}`; known are {known}')


def _path_of(stem: str, text: str) -> Path:
    """Return where the generated module of a law lies, or would."""
    depends = text + ''.join(map(inspect.getsource, SHARED))
    depends += f'{numba.__version__} {np.__version__}'
    digest = hashlib.sha256(depends.encode()).hexdigest()[:16]
    return cache_directory() / f'lane_{stem}_{digest}.py'


def _generated_module(stem: str, text: str) -> ModuleType:
    path = _path_of(stem, text)
    name = path.stem
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        fresh = path.with_suffix(f'.{os.getpid()}')
        fresh.write_text(text, encoding='utf-8')
        fresh.replace(path)
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise UserError(f'cannot load generated file {path}; delete it and try again')
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # numba finds the module of what it cached by this name
    spec.loader.exec_module(module)
    return module


