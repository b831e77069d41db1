"""The linear part of a model as state space, sensors included."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete

from motor_sysid.errors import UserError
from motor_sysid.export.loads import has_a_load, stiff
from motor_sysid.physics.effect import arguments, Effect
from motor_sysid.physics.linear_effects import LinearEffects
from motor_sysid.physics.model import linear_unit, Model, SpeedSensor
from motor_sysid.signals.channels import BY_NAME

Array = NDArray[np.float64]

DIFFERENCED = 'speed as the difference of positions over a sample, half a sample late'
"""What is left out where the speed is told so."""

_UNITS = {'omega': 'rad/s', 'theta': 'rad'}


@dataclass(frozen=True)
class LinearPlant:
    """``dx/dt = A x + B u(t - delay),  y = C x + D u`` about standstill.

    Attributes
    ----------
    a, b, c, d:
        (n, n), (n, n_u), (n_y, n), (n_y, n_u).
    states, inputs, outputs:
        (name, unit) of each; own states of effects have no unit here.
    delay:
        Of the inputs, s.
    left_out:
        What of the model is not in it, in words.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    states: tuple[tuple[str, str], ...]
    inputs: tuple[tuple[str, str], ...]
    outputs: tuple[tuple[str, str], ...]
    delay: float
    left_out: tuple[str, ...]

    def held(self, dt: float) -> tuple[Array, Array]:
        """Return A (n, n) and B (n, n_u) for steps of `dt` s with the input held (ZOH)."""
        a, b, *_ = cont2discrete((self.a, self.b, self.c, self.d), dt, 'zoh')
        return a, b


def inputs_of(model: Model) -> tuple[str, ...]:
    """Return the signals that drive a model; an axis says by its gain and kind which of them."""
    sets = model.kind.inputs
    if ('force',) in sets and model.linear:
        return ('force',)
    if ('current',) in sets and model['gain'] != 1.0:
        return ('current',)
    return sets[0]


def beyond_core(model: Model) -> str:
    """Return in words that a motor kind has laws of its own beside its linear core."""
    return f'what a {model.kind.title} does beyond its linear core'


def linear_plant(model: Model) -> LinearPlant:
    """Return the linear part of a model.

    Effects whose laws are linear (a flexible shaft, the filter of a sensor) are in it, and so is
    the delay of the input; a load behind a play is taken as rigid with the motor.

    Raises
    ------
    UserError
        If the motor has no linear core that says how it moves: its torque turns with the angle.
    """
    kind = model.kind
    if kind.typical is not None:
        raise UserError(
            f'a {kind.title} is not linear: its torque turns with the angle. Export feedforward, '
            'mujoco or urdf, which take the current that drives as command'
        )
    effects = [model.effect(key) for key in model.effects]
    left_out = _left_out(model, effects)
    model = stiff(model, linear=False)
    values = {name: np.array([v]) for name, v in model.parameters.values().items()}
    joined = [one for one in effects if one.card.linear]
    a, b, _ = LinearEffects(kind, joined).extended(kind.matrices(values), values)
    states = (*kind.states, *(name for one in joined for name in one.card.states))
    c, d = _sensors(model, joined, states)
    delays = [model[f'{one.key}.{one.card.delay}'] for one in effects if one.card.delay]
    return LinearPlant(
        a[0], b[0], c, d, tuple((name, _unit(model, name)) for name in states),
        tuple((name, _signal_unit(model, name)) for name in inputs_of(model)),
        tuple((o.signal, _signal_unit(model, o.signal)) for o in kind.outputs),
        sum(delays), tuple(left_out),
    )  # fmt: skip


def _sensors(
    model: Model, joined: list[Effect], states: tuple[str, ...]
) -> tuple[Array, Array]:
    """Return C (n_y, n) and D (n_y, n_u): each output shows its state, and what laws add to it."""
    kind, values = model.kind, model.parameters.values()
    names = (*states, *kind.arguments)
    shown = np.zeros((len(kind.outputs), len(names)))
    for row, output in enumerate(kind.outputs):
        shown[row, names.index(output.state)] = 1.0
        for one in joined:
            law = one.laws.get(f'{output.signal}_sensor')
            if law is None:
                continue
            own = {p.name: values[f'{one.key}.{p.name}'] for p in one.card.parameters}
            held = {n: {**values, **own}.get(n, 0.0) for n in arguments(law)}
            for name in set(names) & {*held}:
                shown[row, names.index(name)] += law(**{**held, name: 1.0})
    return shown[:, : len(states)], shown[:, len(states) :]


def _left_out(model: Model, effects: list[Effect]) -> list[str]:
    found = [
        f'{one.card.title}: {"its load is taken as rigid" if has_a_load(one) else "not linear"}'
        for one in effects
        if not one.card.linear and not one.card.delay
    ]
    if model.kind.own is not None:
        found.append(beyond_core(model))
    if model.speed_sensor is SpeedSensor.DIFFERENCE:
        found.append(DIFFERENCED)
    offsets = [o.bias for o in model.kind.outputs if o.bias and model[o.bias]]
    return found + [f'{name}: an offset of the sensor' for name in offsets]


def _unit(model: Model, state: str) -> str:
    unit = _UNITS.get(state, 'A' if state in model.kind.currents else '')
    return linear_unit(unit) if model.linear else unit


def _signal_unit(model: Model, signal: str) -> str:
    unit = BY_NAME[signal].units[0]
    return linear_unit(unit) if model.linear else unit
