"""A motor as others simulate it: one inertia, viscous and dry friction, and what drives it.

Effects whose torque at a steady speed hangs on nothing else (friction of the catalogue, drag, a
constant load, a user's own law) are evaluated over the speeds that matter, and dry and viscous
friction fitted to them together.  What hangs on angle, current or time, and what lies between
command and torque, has no place in such a model and is told as left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from motor_sysid.control.tuning import reduce_to_speed, torque_constant
from motor_sysid.errors import UserError
from motor_sysid.export.linear import beyond_core, inputs_of
from motor_sysid.export.loads import has_a_load, INERTIAS, stiff
from motor_sysid.physics.effect import arguments, Effect, Law
from motor_sysid.physics.model import linear_unit, Model

Array = NDArray[np.float64]

SPEEDS = 200
"""Speeds at which friction is evaluated."""

_SHARP = 1e-9
"""Width of the sign of speed, in units of the top speed: friction proper, not its rounding."""

_STRAIGHT = 1e-6
"""Share of the friction that a line may miss and be right."""

_ROUNDING = 1e-12
"""Constant torque, relative to friction, that comes of rounding."""

_BY = {
    'theta': 'the angle', 't': 'time', 'i': 'the current', 'turn': 'the angle',
    'domega': 'the acceleration', 'u': 'the input',
}  # fmt: skip


@dataclass(frozen=True)
class Rigid:
    """Inertia and friction on the side of the motor.

    Attributes
    ----------
    inertia:
        Of all that turns, kg m^2 (kg; V s^2/rad where the model knows voltages alone).
    damping:
        Torque per speed, N m s/rad.
    dry:
        Torque against any motion, N m.
    constant:
        Torque that is always there, positive where it drives forward, N m.
    misfit:
        RMS of what `damping` and `dry` miss of the friction, relative to its RMS.
    unit:
        Of torques: N m, N or V.
    left_out:
        What has no place here, in words.
    """

    inertia: float
    damping: float
    dry: float
    constant: float
    misfit: float
    unit: str
    left_out: tuple[str, ...]


@dataclass(frozen=True)
class Drive:
    """From command to torque, the current taken as settled.

    Attributes
    ----------
    signal, unit:
        What is commanded.
    torque:
        Torque per unit of it at rest.
    emf:
        Units of it lost per speed, V s/rad for a voltage.
    lag:
        Time constant of the current that is taken as settled, s.
    """

    signal: str
    unit: str
    torque: float
    emf: float
    lag: float

    @property
    def left_out(self) -> tuple[str, ...]:
        """What has no place here, in words."""
        return (f'the current takes {self.lag:.3g} s to settle',) if self.lag else ()


def rigid(model: Model, top_speed: float | None = None) -> Rigid:
    """Return inertia and friction of a model.

    Parameters
    ----------
    top_speed:
        Largest speed that matters, rad/s (m/s).  Only needed where friction is more than dry and
        viscous.

    Raises
    ------
    UserError
        If it is needed and not given.
    """
    effects = [model.effect(key) for key in model.effects]
    inertia, viscous = _named(stiff(model), *INERTIAS), _named(model, 'b', 'k_v')
    top = top_speed or 1.0
    speeds = np.linspace(1.0 / SPEEDS, 1.0, SPEEDS) * top
    forward, backward, left_out = np.zeros(SPEEDS), np.zeros(SPEEDS), []
    for one in effects:
        reason, pair = _steady(model, one, speeds)
        if reason:
            left_out.append(f'{one.card.title}: {reason}')
        forward, backward = forward + pair[0], backward + pair[1]
    if model.kind.own is not None and len(model.kind.arguments) == 1:
        left_out.append(beyond_core(model))  # the voltage that commutation takes
    friction = viscous * speeds + 0.5 * (backward - forward)
    table = np.column_stack([speeds, np.ones(SPEEDS)])
    (damping, dry), rest = nnls(table / [top, 1.0], friction)
    size = float(np.linalg.norm(friction))
    misfit = float(rest) / size if size else 0.0
    if misfit > _STRAIGHT and top_speed is None:
        raise UserError(
            'friction of this model is more than dry and viscous: it takes the largest speed that '
            'matters to say which of both come closest; give --top-speed'
        )
    if misfit > _STRAIGHT:
        left_out.append(f'{100 * misfit:.2g} % of the friction, which is no straight line')
    constant = float(np.mean(forward + backward)) / 2
    constant = constant if abs(constant) > _ROUNDING * size else 0.0
    unit = next((f.unit for f in model.kind.forces if f.name == 'torque'), 'N m')
    unit = linear_unit(unit) if model.linear else unit
    return Rigid(
        inertia, float(damping) / top, float(dry), constant, misfit, unit, tuple(left_out)
    )


def drive(model: Model) -> Drive:
    """Return what one unit of the command does.

    That is the input of a motor with one input, and else the current that drives, as a
    three-phase drive controls it.

    Raises
    ------
    UserError
        If nothing drives the motor: its motion is the input.
    """
    kind = model.kind
    if 'omega' not in kind.states:
        raise UserError(
            f'a {kind.title} has its motion as input, and nothing that drives it; '
            'fit a motor that a voltage, a torque or a current drives'
        )
    if len(kind.arguments) > 1:
        return Drive('current', 'A', torque_constant(model), 0.0, 0.0)
    plant, inertia = reduce_to_speed(model), _named(model, *INERTIAS)
    torque = inertia * plant.gain / plant.time_constant
    emf = (inertia / plant.time_constant - _named(model, 'b', 'k_v')) / torque
    signal = inputs_of(model)[0]
    unit = {'torque': 'N m', 'force': 'N', 'current': 'A', 'current_q': 'A'}.get(signal, 'V')
    return Drive(signal, unit, torque, max(emf, 0.0), plant.neglected)


def _named(model: Model, *names: str) -> float:
    """Return the parameter that the motor kind calls by one of these names."""
    for name in names:
        if name in model.parameters:
            return model[name]
    raise UserError(f'a {model.kind.title} has no parameter {" or ".join(names)}')


def _steady(model: Model, one: Effect, speeds: Array) -> tuple[str, Array]:
    """Return why an effect is left out, or '', and its torque (2, n) at speeds and back."""
    nothing = np.zeros((2, speeds.size))
    if has_a_load(one):
        return 'the load is taken as rigid with the motor', nothing
    laws = [law for name, law in one.laws.items() if name.endswith('torque')]
    if not laws:
        return _beside(one), nothing
    values = {p.name: p.value for p in model.parameters}
    values |= {p.name: model[f'{one.key}.{p.name}'] for p in one.card.parameters}
    values['omega_eps'] = _SHARP * float(speeds[-1])
    free = {'omega', *values, *one.card.states}
    foreign = [n for law in (*laws, *one.rates.values()) for n in arguments(law) if n not in free]
    if foreign:
        return f'depends on {_BY.get(foreign[0], foreign[0])}', nothing
    try:
        torque = np.array(
            [[_at(one, laws, values, sign * w) for w in speeds] for sign in (1.0, -1.0)]
        )
    except np.linalg.LinAlgError:
        return 'does not settle at a steady speed', nothing
    return '', torque


def _at(one: Effect, laws: list[Law], values: Mapping[str, float], omega: float) -> float:
    """Return the torque at a steady speed, its own states (linear in their rates) settled."""
    held = {**values, 'omega': omega}
    names = one.card.states
    if names:
        zero = dict.fromkeys(names, 0.0)

        def rates(states: Mapping[str, float]) -> Array:
            given = {**held, **states}
            return np.array([_call(one.rates[name], given) for name in names])

        begin = rates(zero)
        slopes = np.column_stack([rates({**zero, name: 1.0}) - begin for name in names])
        held |= dict(zip(names, np.linalg.solve(slopes, -begin).tolist(), strict=True))
    return sum(_call(law, held) for law in laws)


def _call(law: Law, given: Mapping[str, float]) -> float:
    return law(**{name: given[name] for name in arguments(law)})


def _beside(one: Effect) -> str:
    """Return where an effect without a torque of its own enters."""
    if any(name.endswith('sensor') for name in one.laws):
        return 'belongs to the sensor'
    return 'lies between command and torque'
