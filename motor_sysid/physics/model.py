"""A model is a value: a motor kind, the effects added to it, and their parameters."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

from motor_sysid.errors import UserError
from motor_sysid.physics.effect import Amplitude, Effect, Scale, Shape
from motor_sysid.physics.effects import effect
from motor_sysid.physics.motors import motor
from motor_sysid.physics.motors.base import Motor
from motor_sysid.physics.parameters import Parameter, ParameterSet
from motor_sysid.physics.scales import Scales


class SpeedSensor(Enum):
    """How the speed signal comes about."""

    IDEAL = 'ideal'
    """The speed at the sample time."""

    DIFFERENCE = 'difference'
    """The difference of the position over the last sample, half a sample late."""

    SAMPLED = 'sampled'
    """The speed at the sample time; a filter of it takes sample by sample, as a drive does."""


_LINEAR_UNITS = (('kg m^2', 'kg'), ('N m', 'N'), ('rad', 'm'))
"""What units of a rotary motor become on a linear axis, in this order."""


@dataclass(frozen=True)
class Model:
    """A motor model.

    Attributes
    ----------
    motor:
        Key of the motor kind.
    effects:
        Keys of the effects that it has, in the order of adding.
    parameters:
        Parameters of the motor, then of its effects (``effect_key.symbol``).
    speed_sensor:
        How the speed is measured.
    linear:
        Whether the axis is linear: m, m/s, N and kg in place of rad, rad/s, N m and kg m^2.
    provenance:
        Where it came from: name and SHA-256 of the data, validity range, version.
    """

    motor: str
    effects: tuple[str, ...]
    parameters: ParameterSet
    speed_sensor: SpeedSensor = SpeedSensor.IDEAL
    linear: bool = False
    provenance: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def base(
        cls,
        key: str,
        values: Mapping[str, float] | None = None,
        *,
        speed_sensor: SpeedSensor = SpeedSensor.IDEAL,
        linear: bool = False,
    ) -> 'Model':
        """Return a linear model of that motor kind, with default values where none are given.

        Raises
        ------
        UserError
            If the kind or a parameter is unknown or a value lies outside its box.
        """
        kind = motor(key)
        items = tuple(_linear(p) if linear else p for p in kind.parameters)
        parameters = ParameterSet(items).with_values(values or {})
        return cls(key, (), parameters, speed_sensor, linear)

    @property
    def kind(self) -> Motor:
        """The motor kind."""
        return motor(self.motor)

    def __getitem__(self, name: str) -> float:
        """Return the value of a parameter."""
        return self.parameters[name].value

    def with_effect(
        self,
        key: str,
        values: Mapping[str, float] | None = None,
        scales: Scales | None = None,
    ) -> 'Model':
        """Return the model with one effect more.

        Effects that the new one replaces go, and it starts from their values, kept inside its
        boxes; a parameter of the motor that does the same is held from now on.  `values` name
        the effect's parameters without its key; the others start at zero (amplitudes) or at their
        first start (shapes).  With `scales` the boxes are those of the card; without, they are
        wide open.

        Raises
        ------
        UserError
            If the effect is unknown, is there already, or needs what the motor does not have.
        """
        new = self.kind.taking(effect(key))
        if key in self.effects:
            raise UserError(f'the model has `{key}` already')
        if not self.admits(new):
            missing = sorted(new.needs() - self.kind.names())
            if not missing and not new.laws:
                missing = ['an equation or a sensor']
            missing = missing or ['an angle' if new.card.rotary else 'a speed sensor of its own']
            raise UserError(
                f'`{key}` needs {", ".join(missing)}, which this {self.kind.title} model '
                'does not have'
            )
        slim, inherited = self, {}
        for special, pairs in new.card.replaces.items():
            if special in slim.effects:
                inherited = {mine: self[f'{special}.{theirs}'] for mine, theirs in pairs}
                slim = slim.without_effect(special)
        added = [_effect_parameter(new, p, scales) for p in new.card.parameters]
        torque = next((f.unit for f in self.kind.forces if f.name == 'torque'), 'N m')
        added = [replace(p, unit=p.unit.replace('N m', torque)) for p in added]
        if self.linear:
            cards = zip(added, new.card.parameters, strict=True)
            added = [p if card.scale is Scale.RATE else _linear(p) for p, card in cards]
        covered = [p.name for p in slim.parameters if p.name == new.card.covers]
        boxes = {p.name: p for p in added}
        taken = {f'{key}.{name}': value for name, value in inherited.items()}
        taken = {n: min(max(v, boxes[n].lower), boxes[n].upper) for n, v in taken.items()}
        given = {f'{key}.{name}': value for name, value in (values or {}).items()}
        kept = slim.parameters.with_free(covered, False)
        parameters = kept.plus(added).with_values({**taken, **given})
        return replace(slim, effects=(*slim.effects, key), parameters=parameters)

    def effect(self, key: str) -> Effect:
        """Return an effect with the laws that this motor takes."""
        return self.kind.taking(effect(key))

    def admits(self, one: Effect) -> bool:
        """Whether the effect makes sense for this motor: it asks for nothing that is not there.

        Counts differenced over a sample have no offset and no wrong scale, though they may be
        filtered, a linear axis has no angle, and some motors have no brushes.
        """
        one = self.kind.taking(one)
        if not one.laws and not one.card.delay:
            return False
        if one.key in self.kind.foreign or not {*one.card.begins.values()} <= {*self.kind.states}:
            return False
        counted = self.speed_sensor is SpeedSensor.DIFFERENCE
        if counted and 'speed_sensor' in one.laws and not one.card.states:
            return False
        return not one.needs() - self.kind.names() and not (self.linear and one.card.rotary)

    def lacks(self, one: Effect) -> bool:
        """Whether the effect may be looked for: it is not there, makes sense, and is due."""
        due = not one.after or one.after in self.effects
        return due and one.key not in self.effects and self.admits(one)

    @property
    def is_sound(self) -> bool:
        """Whether the effects of the model make sense for its motor and its sensors."""
        return all(self.admits(effect(key)) for key in self.effects)

    @property
    def filters_speed(self) -> bool:
        """Whether the speed passes a filter, which may take sample by sample."""
        return any(one.filters_speed for one in map(self.effect, self.effects))

    def without_effect(self, key: str) -> 'Model':
        """Return the model with one effect less."""
        if key not in self.effects:
            have = ', '.join(self.effects) or 'none'
            raise UserError(f'the model has no `{key}`; it has {have}')
        names = [p.name for p in self.parameters if p.name.startswith(f'{key}.')]
        less = replace(
            self,
            effects=tuple(k for k in self.effects if k != key),
            parameters=self.parameters.without(names),
        )
        return less.with_speed_sensor(self.speed_sensor)

    def with_speed_sensor(self, sensor: SpeedSensor) -> 'Model':
        """Return the model with a speed sensor; one that filters without a filter is ideal."""
        idle = sensor is SpeedSensor.SAMPLED and not self.filters_speed
        return replace(self, speed_sensor=SpeedSensor.IDEAL if idle else sensor)

    def with_values(self, values: Mapping[str, float]) -> 'Model':
        """Return the model with other parameter values."""
        return replace(self, parameters=self.parameters.with_values(values))

    def with_estimates(
        self, values: Mapping[str, float], sigmas: Mapping[str, float]
    ) -> 'Model':
        """Return the model with estimated values and their standard deviations."""
        return replace(
            self, parameters=self.parameters.with_values(values).with_sigmas(sigmas)
        )

    def with_free(self, names: Iterable[str], free: bool = True) -> 'Model':
        """Return the model in which the named parameters are free (or fixed) in fits."""
        return replace(self, parameters=self.parameters.with_free(names, free))

    def with_provenance(self, **notes: str) -> 'Model':
        """Return the model with more notes on where it came from."""
        return replace(self, provenance={**self.provenance, **notes})


def _effect_parameter(owner: Effect, card: Amplitude | Shape, scales: Scales | None) -> Parameter:
    size = scales.size(card.scale) if scales else 1.0
    if isinstance(card, Amplitude):
        reach = card.limit * size if scales else 1e12
        value, lower, upper, free = 0.0, 0.0 if card.positive else -reach, reach, True
        if scales and owner.filters_speed and card.name == owner.card.filter:
            lower, longest = scales.speed_filter
            value, upper = lower, min(reach, longest)
    else:
        start = card.starts[0] if card.starts else card.lower
        value = start * size
        least = 0.0 if card.lower == 0 else 1e-12 if card.lower > 0 else -1e12
        lower, upper = (card.lower * size, card.upper * size) if scales else (least, 1e12)
        free = card.free
    return Parameter(
        f'{owner.key}.{card.name}', card.unit, value, lower, upper, card.description, free
    )


def linear_unit(unit: str) -> str:
    """Return the unit on a linear axis of what has the given unit on a rotary motor."""
    for rotary, straight in _LINEAR_UNITS:
        unit = unit.replace(rotary, straight)
    return unit


def _linear(parameter: Parameter) -> Parameter:
    return replace(parameter, unit=linear_unit(parameter.unit))
