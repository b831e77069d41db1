"""Where a run begins: at what its sensors stand for, which need not be what they show."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.chains import Stretch
from motor_sysid.physics.effect import arguments, Effect
from motor_sysid.physics.model import Model

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
    undone = []
    for output in model.kind.outputs:
        name = f'{output.signal}_sensor'
        sensing = [one for one in effects if name in one.laws]
        if sensing:
            low, high = (
                sum(_added(one, name, table, {output.state: at}) for one in sensing)
                for at in (0.0, 1.0)
            )
            place = model.kind.states.index(output.state)
            undone.append((output.signal, place, low, 1.0 + high - low))
    return [_begun(stretch, undone) for stretch in stretches]


def _begun(
    stretch: Stretch, undone: Sequence[tuple[str, int, Array | float, Array | float]]
) -> Array:
    """Return where a stretch begins; `undone` are signal, state, offset and slope of sensors."""
    state = stretch.state
    for signal, place, offset, slope in undone:
        if place in stretch.open_states and signal in stretch.record:
            begun = (stretch.state[place] - offset) / slope
            state = np.tile(state, (np.size(begun), 1)) if state.ndim == 1 else state
            state[:, place] = begun
    return state


def _added(
    one: Effect, name: str, table: Mapping[str, Array], state: Mapping[str, float]
) -> Array | float:
    """Return what a law of an effect adds to a reading at a state, for (P,) parameters."""
    law = one.laws[name]
    added: Array | float = law(
        *[state[n] if n in state else table[f'{one.key}.{n}'] for n in arguments(law)]
    )
    return added
