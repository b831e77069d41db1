"""Where a run begins: at what its sensors stand for, which need not be what they show."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.chains import Stretch
from motor_sysid.physics.effect import arguments
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
    effects = [model.effect(key) for key in model.effects]
    columns = {}
    for output in model.kind.outputs:
        place, name = model.kind.states.index(output.state), f'{output.signal}_sensor'
        laws = [
            (one.key, one.laws[name])
            for one in effects
            if name in one.laws and not one.card.states
        ]
        if laws and place in stretch.open_states and output.signal in stretch.record:
            low, high = np.sum(
                [
                    [
                        law(*[
                            state if n == output.state else table[f'{key}.{n}']
                            for n in arguments(law)
                        ])
                        for state in (0.0, 1.0)
                    ]
                    for key, law in laws
                ],
                axis=0,
            )  # fmt: skip
            columns[place] = (stretch.state[place] - low) / (1.0 + high - low)
    if not columns:
        return stretch.state
    state = np.tile(stretch.state, (len(next(iter(columns.values()))), 1))
    for place, values in columns.items():
        state[:, place] = values
    return state
