"""Where a run begins: at what its sensors stand for, which need not be what they show."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.chains import Stretch
from motor_sysid.physics.effect import arguments, Effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]


def start_of(model: Model, table: Mapping[str, Array], stretch: Stretch) -> Array:
    """Return (P, n) initial states of a stretch, or (n,) where they are the same for all.

    Of a state that was read from what a sensor shows, the model's own laws of that sensor are
    undone.  They are straight lines in the state; a filter shows what it is fed, once settled.

    Parameters
    ----------
    model:
        The model, whose effects count.
    table:
        Parameter to its (P,) values.
    stretch:
        Where the run begins, as shown.
    """
    effects = [one for one in map(model.effect, model.effects) if not one.card.states]
    state = stretch.state
    for output in model.kind.outputs:
        place, name = model.kind.states.index(output.state), f'{output.signal}_sensor'
        sensing = [one for one in effects if name in one.laws]
        if sensing and place in stretch.open_states and output.signal in stretch.record:
            low, high = (
                sum(_added(one, name, table, {output.state: at}) for one in sensing)
                for at in (0.0, 1.0)
            )
            begun = (stretch.state[place] - low) / (1.0 + high - low)
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
