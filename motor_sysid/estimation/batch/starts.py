"""Where a run begins: at what its sensors stand for, which need not be what they show."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.chains import Stretch
from motor_sysid.physics.effect import arguments, Effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.base import Motor, Output

Array = NDArray[np.float64]


def starts_of(
    model: Model, table: Mapping[str, Array], stretches: Sequence[Stretch]
) -> list[Array]:
    """Return (P, n) initial states of stretches, or (n,) where they are the same for all.

    Of a state that was read from what a sensor shows, the model's own laws of that sensor are
    undone.  They are straight lines in the state; a filter shows what it is fed, once settled.

    Parameters
    ----------
    model:
        The model, whose effects count.
    table:
        Parameter to its (P,) values.
    stretches:
        Where the runs begin, as shown.
    """
    effects = [one for one in map(model.effect, model.effects) if not one.card.states]
    sensing = [
        (output, laws) for output in model.kind.outputs
        if (laws := [one for one in effects if f'{output.signal}_sensor' in one.laws])
    ]  # fmt: skip
    return [_begun(model.kind, stretch, sensing, table) for stretch in stretches]


def _begun(
    kind: Motor,
    stretch: Stretch,
    sensing: Sequence[tuple[Output, Sequence[Effect]]],
    table: Mapping[str, Array],
) -> Array:
    """Return where a stretch begins; `sensing` are outputs with what adds to their sensors."""
    state = stretch.state
    for output, effects in sensing:
        place = kind.states.index(output.state)
        read = place in stretch.open_states or stretch.state[place] != 0.0  # else it is at rest
        if read and output.signal in stretch.record:
            known: dict[str, Array | float] = {**table, **_seen(kind, stretch)}
            offset, high = (
                _added(effects, output.signal, {**known, output.state: at}) for at in (0.0, 1.0)
            )
            begun = (stretch.state[place] - offset) / (1.0 + high - offset)
            state = np.tile(state, (np.size(begun), 1)) if state.ndim == 1 else state
            state[:, place] = begun
    return state


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
