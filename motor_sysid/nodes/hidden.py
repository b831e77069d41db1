"""What is hidden in a simulated motor: effects that the rest of the system is not told of."""

from collections.abc import Mapping, Sequence
import math

from motor_sysid.control.tuning import torque_constant
from motor_sysid.errors import UserError
from motor_sysid.physics.effect import Card, Scale
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.scales import Scales

SHARE = {
    Scale.TORQUE: 0.05,
    Scale.DRAG: 0.05,
    Scale.VOLTAGE: 0.06,
    Scale.SAMPLE: 1.5,
    Scale.HEATING: 0.2,
}
"""Size of a hidden effect whose parameters are not given, as a share of the motor's scale."""

WAVES = 7.0
"""Waves per turn of a hidden effect that counts them."""


def scales_of_drive(model: Model, supply_voltage: float, dt: float) -> Scales:
    """Return typical sizes of a motor at half its no-load speed and a quarter of stall current."""
    values = model.parameters.values()
    current = 0.25 * supply_voltage / values.get('R', 1.0)
    k_t = torque_constant(model)
    return Scales(
        torque=k_t * current,
        speed=0.5 * supply_voltage / k_t,
        current=current,
        voltage=0.5 * supply_voltage,
        sample=dt,
        duration=20.0,
        loss=values.get('R', 1.0) * current**2,
    )


def with_hidden(
    model: Model, keys: Sequence[str], given: Mapping[str, float], scales: Scales
) -> Model:
    """Return the model with hidden effects; parameters that are not given get a plausible size.

    Raises
    ------
    UserError
        If an effect or a parameter is unknown, or one is given of an effect that is not hidden.
    """
    for name in given:
        owner, _, _ = name.rpartition('.')
        if owner and owner not in keys:
            raise UserError(
                f'`{name}` is given, but `{owner}` is not hidden; hide it, too '
                '(`hidden_effects`), or take its parameters out of `hidden_parameters`: both may '
                'be changed in one call'
            )
    for key in keys:
        model = model.with_effect(key, _sizes(effect(key).card, scales))
    return model.with_values(given)


def _sizes(card: Card, scales: Scales) -> dict[str, float]:
    sizes = {
        a.name: SHARE.get(a.scale, 0.05) * scales.size(a.scale) / (1 + k)
        for k, a in enumerate(card.amplitudes)
    }
    for shape in card.shapes:
        start = shape.starts[0] if shape.starts else WAVES
        sizes[shape.name] = start * scales.size(shape.scale)
    return sizes


def parse_assignments(texts: Sequence[str]) -> dict[str, float]:
    """Return ``('coulomb_friction.tau_c=0.01', ...)`` as a mapping.

    Raises
    ------
    UserError
        If a text is not ``name=number``.
    """
    values: dict[str, float] = {}
    for text in texts:
        name, separator, number = text.partition('=')
        try:
            values[name.strip()] = float(number)
        except ValueError:
            separator = ''
        if not separator or not math.isfinite(values[name.strip()]):
            raise UserError(f'`{text}` is not `effect.parameter=number` in SI units')
    return values
