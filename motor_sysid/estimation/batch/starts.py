"""Where a run begins: at what its sensors stand for, which need not be what they show."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.chains import Stretch
from motor_sysid.physics.effect import arguments, Effect
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
    ago.  Where there is a filter, the own states of effects that begin with a state of the motor
    follow the n states, in their order: that of a filter is what the sensor shows.

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
    filtered = any(one.filtering for one in sensing)
    found = []
    for stretch in stretches:
        state, passed = _begun(model, stretch, sensing, table)
        if shifts is not None:
            state = state + shifts * stretch.state_size
        found.append(_with_own(model.kind, effects, state, passed) if filtered else state)
    return found


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
    kind: Motor, effects: Sequence[Effect], state: Array, passed: Mapping[str, Array | float]
) -> Array:
    """Return (P, n) or (n,) states and, after them, own states of effects that begin with one."""
    own = [
        passed.get(one.key, state[..., kind.states.index(core)])
        for one in effects for core in one.card.begins.values()
    ]  # fmt: skip
    size = state.shape[:-1]
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
