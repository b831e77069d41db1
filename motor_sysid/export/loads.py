"""Loads behind a shaft or a play, taken as rigid with the motor where a format knows no others."""

from motor_sysid.physics.effect import Effect
from motor_sysid.physics.model import Model

INERTIAS = ('J', 'k_a')
"""What motor kinds call their inertia."""


def has_a_load(one: Effect) -> bool:
    """Whether an effect has a load of its own, whose inertia the motor holds without it."""
    return bool({*INERTIAS} & {*one.card.shrinks})


def stiff(model: Model, *, linear: bool = True) -> Model:
    """Return the model with its loads rigid on the shaft of the motor.

    Parameters
    ----------
    linear:
        Whether loads on linear shafts are, too.
    """
    for one in map(model.effect, model.effects):
        if has_a_load(one) and (linear or not one.card.linear):
            ratio = model[f'{one.key}.{one.card.amplitudes[0].name}']
            (name,) = (n for n in INERTIAS if n in model.parameters)
            whole = model[name] * (1.0 + ratio)
            model = model.without_effect(one.key).with_values({name: whole})
    return model
