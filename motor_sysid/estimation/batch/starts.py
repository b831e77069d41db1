"""Where a run begins: at what its sensors stand for, which need not be what they show."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.chains import Stretch
from motor_sysid.physics.effect import arguments, Effect, Law
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.base import Motor, Output
from motor_sysid.physics.summed import is_stepwise

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Sensor:
    """What a model says of a sensor: the output, its filter if it has one, and what else adds."""

    output: Output
    filtering: Effect | None
    adding: Sequence[Effect]


def starts_of(
    model: Model,
    table: Mapping[str, Array],
    stretches: Sequence[Stretch],
    shifts: Array | None = None,
) -> list[Array]:
    """Return (P, n) initial states of stretches, or (n,) where they are the same for all.

    Of a state that was read from what a sensor shows, the model's own laws of that sensor are
    undone.  They are straight lines in the state; a filter shows what it was fed a time constant
    ago.  Where there is a filter, or an effect that tells where its own states begin, own states
    that do not begin with zero follow the n states, in their order: that of a filter is what the
    sensor shows.

    Parameters
    ----------
    model:
        The model, whose effects count.
    table:
        Parameter to its (P,) values.
    stretches:
        Where the runs begin, as shown.
    shifts:
        (P, n) changes of the states in units of the stretch's state size.
    """
    effects = [model.effect(key) for key in model.effects]
    sensing = [_sensor(output, effects) for output in model.kind.outputs]
    sensing = [one for one in sensing if one.filtering or one.adding]
    own = any(one.filtering for one in sensing) or any(one.starts for one in effects)
    found = []
    for stretch in stretches:
        state, passed = _begun(model, stretch, sensing, table)
        if shifts is not None:
            state = state + shifts * stretch.state_size
        if own:
            state = _with_own(model.kind, effects, state, passed, stretch, table)
        found.append(state)
    return found


def told_at_start(
    law: Law, key: str, kind: Motor, stretch: Stretch, table: Mapping[str, Array]
) -> Array | float:
    """Return what a law of the effect `key` tells of where a stretch begins, for (P,) values.

    It may ask for what is read there, for the rates of states (`d` before the name), and for
    parameters.
    """
    rates = (f'd{name}' for name in kind.states)
    known: dict[str, Array | float] = {**table, **_seen(kind, stretch)}
    known |= dict(zip(rates, stretch.rate.tolist(), strict=True))
    return law(*[known.get(f'{key}.{n}', known.get(n, np.nan)) for n in arguments(law)])


def _sensor(output: Output, effects: Sequence[Effect]) -> _Sensor:
    mine = [one for one in effects if f'{output.signal}_sensor' in one.laws]
    filtering = next((one for one in mine if one.card.filter), None)
    return _Sensor(output, filtering, [one for one in mine if not one.card.states])


def _begun(
    model: Model, stretch: Stretch, sensing: Sequence[_Sensor], table: Mapping[str, Array]
) -> tuple[Array, dict[str, Array | float]]:
    """Return where a stretch begins, and what has passed the filter of each effect that is one."""
    state, passed = stretch.state, dict[str, Array | float]()
    for one in sensing:
        place = model.kind.states.index(one.output.state)
        read = place in stretch.open_states or stretch.state[place] != 0.0  # else it is at rest
        if not read or one.output.signal not in stretch.record:
            continue
        known: dict[str, Array | float] = {**table, **_seen(model.kind, stretch)}
        offset, high = (
            _added(one.adding, one.output.signal, {**known, one.output.state: at})
            for at in (0.0, 1.0)
        )
        gain = 1.0 + high - offset
        begun, slope = (stretch.state[place] - offset) / gain, stretch.rate[place] / gain
        if one.filtering:
            late = is_stepwise(one.filtering, model.speed_sensor)
            passed[one.filtering.key] = begun - late * slope * stretch.drive.dt
            begun = begun + slope * table[f'{one.filtering.key}.{one.filtering.card.filter}']
        state = np.tile(state, (np.size(begun), 1)) if state.ndim == 1 else state
        state[:, place] = begun
    return state, passed


def _with_own(
    kind: Motor, effects: Sequence[Effect], state: Array, passed: Mapping[str, Array | float],
    stretch: Stretch, table: Mapping[str, Array],
) -> Array:  # fmt: skip
    """Return (P, n) or (n,) states and, after them, own states that do not begin with zero."""
    own: list[Array | float] = []
    for one in effects:
        cores = map(kind.states.index, one.card.begins.values())
        own += [passed.get(one.key, state[..., core]) for core in cores]
        own += [told_at_start(law, one.key, kind, stretch, table) for law in one.starts.values()]
    size = np.broadcast_shapes(state.shape[:-1], *map(np.shape, own))
    state = np.broadcast_to(state, (*size, state.shape[-1]))
    more = np.stack([np.broadcast_to(value, size) for value in own], axis=-1)
    return np.concatenate((state, more), axis=-1)


def _seen(kind: Motor, stretch: Stretch) -> dict[str, float]:
    """Return what laws see where a stretch begins, as it is shown."""
    drive = stretch.drive
    states = dict(zip(kind.states, stretch.state.tolist(), strict=True))
    inputs = dict(zip(kind.arguments, drive.inputs[0].tolist(), strict=True))
    told = {'theta': float(drive.position[0])} if drive.position.size else {}
    turn = drive.dt * states.get('omega', 0.0)
    return {'turn': turn, **states, **inputs, **told, 't': drive.start}


def _added(
    effects: Sequence[Effect], signal: str, known: Mapping[str, Array | float]
) -> Array | float:
    """Return what effects add to a reading, for (P,) parameters, but for laws that ask more."""
    total: Array | float = 0.0
    for one in effects:
        law = one.laws[f'{signal}_sensor']
        names = [f'{one.key}.{n}' if f'{one.key}.{n}' in known else n for n in arguments(law)]
        if set(names) <= known.keys():
            total = total + law(*[known[name] for name in names])
    return total
