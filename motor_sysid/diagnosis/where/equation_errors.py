"""The unexplained torque and voltage: what each equation of the model lacks, sample by sample.

From measured states and inputs each equation is solved for the force that would close it.  The
derivative comes from a local cubic, and every other term is smoothed by the same filter, so that
neither side is delayed against the other.  Used to show and to look for shapes; verdicts come from
simulation, which needs no derivative.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from motor_sysid.physics.drive import Drive, input_signals
from motor_sysid.physics.effect import arguments, Effect, SECOND
from motor_sysid.physics.effects import effect
from motor_sysid.physics.linear_effects import along
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors.base import Output
from motor_sysid.physics.motors.speed import measured_speed
from motor_sysid.physics.summed import seen_by
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

WINDOW = 11
_DEGREE = 3


def measured_states(model: Model, record: Record) -> dict[str, Array]:
    """Return the measured states of a uniform record, and its inputs as laws see them.

    What sensors add without memory is taken out, and a differenced speed is moved back by half a
    sample.
    """
    kind, states = model.kind, {}
    for output in kind.outputs:
        if output.signal in record:
            states[output.state] = _measured(model, output, record[output.signal])
    speed = states['omega'] if 'omega' in states else measured_speed(record)
    if 'speed' in record and model.speed_sensor is SpeedSensor.DIFFERENCE:
        speed = np.append(0.5 * (speed[1:] + speed[:-1]), speed[-1])
    states['omega'] = speed
    drive = seen_by(model, Drive.of(record, kind))
    if drive.position.size:
        states['theta'] = drive.position
    inputs = [record[name] for name in input_signals(record, kind)]
    states.update(zip(kind.arguments, inputs, strict=True))
    states['t'] = record.clock
    states['turn'] = record.dt * states['omega']
    asked = {name for key in model.effects for name in model.effect(key).needs()}
    if any(f'd{force.own_state}' in asked for force in kind.forces):
        states.update(rates_of(model, states, record.dt))
    return states


def _measured(model: Model, output: Output, shown: Array) -> Array:
    """Return what a sensor measures, (N,), of what it shows; its laws are straight lines."""
    offset, gain = model[output.bias] if output.bias else 0.0, 1.0
    for one in map(model.effect, model.effects):
        law = one.laws.get(f'{output.signal}_sensor')
        own = {p.name: model[f'{one.key}.{p.name}'] for p in one.card.parameters}
        known = {**model.parameters.values(), **own}
        if law is not None and set(arguments(law)) <= {*known, output.state}:
            still, moved = (law(*[known.get(n, x) for n in arguments(law)]) for x in (0.0, 1.0))
            offset, gain = offset + still, gain + moved - still
    return (shown - offset) / gain


def rates_of(model: Model, states: Mapping[str, Array], dt: float) -> dict[str, Array]:
    """Return the rates of change (N,) of the measured own states of the equations, d + name."""
    owns = [force.own_state for force in model.kind.forces]
    return {
        f'd{own}': savgol_filter(states[own], WINDOW, _DEGREE, deriv=1, delta=dt)
        for own in owns
        if own in states and states[own].size > WINDOW
    }


def unexplained(model: Model, record: Record) -> dict[str, Array]:
    """Return for each equation with a measured own state the (N,) force that it lacks.

    The effects that the model has are accounted for.
    """
    even = record.uniform()
    if len(even) <= WINDOW:
        return {}
    states = measured_states(model, even)
    lacking = {}
    for name, (rate, gain) in balance(model, states).items():
        own = next(f.own_state for f in model.kind.forces if f.name == name)
        slope = savgol_filter(states[own], WINDOW, _DEGREE, deriv=1, delta=even.dt)
        lacking[name] = (slope - savgol_filter(rate, WINDOW, _DEGREE)) / gain
    return lacking


def lacking_name(model: Model, force: str) -> str:
    """Return what people call the force that an equation lacks."""
    unit = next(f.unit for f in model.kind.forces if f.name == force)
    if unit == 'N m':
        return 'unexplained force' if model.linear else 'unexplained torque'
    _, _, axis = force.partition('_')
    return f'unexplained voltage {axis}'.rstrip()


def balance(model: Model, states: Mapping[str, Array]) -> dict[str, tuple[Array, float]]:
    """Return for each equation with a measured own state its rate of change and force gain.

    The rate (N,) is what the model, effects included, gives the own state at the given states; the
    gain is the rate that one unit of force makes.
    """
    kind = model.kind
    delays = [f'{key}.{effect(key).card.delay}' for key in model.effects if effect(key).card.delay]
    late = sum(model[name] for name in delays)
    seen = dict(states)
    for name in kind.arguments:
        seen[name] = np.interp(states['t'] - late, states['t'], states[name])
    values = {name: np.array([v]) for name, v in model.parameters.values().items()}
    a, b, g = (matrix[0] for matrix in kind.matrices(values))
    known = known_forces(model, seen)
    rates = {}
    for column, force in enumerate(kind.forces):
        row = kind.states.index(force.own_state)
        needed = [j for j in range(len(kind.states)) if a[row, j] != 0]
        if force.own_state not in seen or any(kind.states[j] not in seen for j in needed):
            continue
        rate = g[row, column] * known[force.name]
        for j in needed:
            rate = rate + a[row, j] * seen[kind.states[j]]
        for j, name in enumerate(kind.arguments):
            rate = rate + b[row, j] * seen[name]
        rates[force.name] = (rate, float(g[row, column]))
    return rates


def known_forces(model: Model, states: Mapping[str, Array]) -> dict[str, Array]:
    """Return for each equation the (N,) force of the model's own effects along given states."""
    size = next(iter(states.values())).size
    forces = {force.name: np.zeros(size) for force in model.kind.forces}
    effects = [model.effect(key) for key in model.effects]
    for one in (*effects, *([model.kind.own] if model.kind.own else [])):
        known: dict[str, Array | float] = {**states, **model.parameters.values()}
        known.update({p.name: model[f'{one.key}.{p.name}'] for p in one.card.parameters})
        if one.card.states:
            known.update(_memory(model, one, known, states))
        for name, law in one.laws.items():
            force = name.removeprefix(SECOND)
            if force in forces and set(arguments(law)) <= set(known):
                given = [known[n] for n in arguments(law)]
                forces[force] = forces[force] + law(*given)
    return forces


def _memory(
    model: Model,
    one: Effect,
    known: Mapping[str, Array | float],
    states: Mapping[str, Array],
) -> dict[str, Array]:
    """Integrate an effect's own states along measured states, one step a sample.

    Those of a linear effect are exact.  Of others each takes the newest value of those before it
    (semi-implicit Euler), which keeps a spring and a mass from growing; one that fades by itself
    does so exponentially.
    """
    time = states['t']
    if one.card.linear:
        dt = float(np.mean(np.diff(time)))
        return along(one, model.kind, model.parameters.values(), states, dt)
    own = dict.fromkeys(one.card.states, 0.0)
    own.update({s: float(states[x][0]) for s, x in one.card.begins.items() if x in states})
    path = {name: np.zeros(time.size) for name in own}
    names = {s: arguments(rate) for s, rate in one.rates.items()}
    if any(n not in known and n not in own for wanted in names.values() for n in wanted):
        return path
    columns = {
        n: np.broadcast_to(np.asarray(known[n], dtype=float), time.shape).tolist()
        for wanted in names.values()
        for n in wanted
        if n not in own
    }
    for k in range(time.size - 1):
        step = float(time[k + 1] - time[k])
        for s, rate in one.rates.items():
            given = {n: own[n] if n in own else columns[n][k] for n in names[s]}
            now = float(rate(*given.values()))
            if s in given:
                reach = step * abs(now) + 1e-9 * abs(own[s]) + 1e-30
                given[s] = own[s] + reach
                fade = max(step * (now - float(rate(*given.values()))) / reach, 1e-9)
                now *= -np.expm1(-fade) / fade
            own[s] += now * step
            path[s][k + 1] = own[s]
    return {s: np.nan_to_num(values, posinf=0.0, neginf=0.0) for s, values in path.items()}


def surroundings(spectrum: Array, reach: int) -> Array:
    """Return (N,) the median of each line and of `reach` lines on either side, without line 0."""
    found = np.empty(spectrum.size)
    width = 2 * reach + 1
    inner = range(min(reach + 1, spectrum.size), spectrum.size - reach)
    for k in (*range(inner.start), *range(max(inner.start, inner.stop), spectrum.size)):
        found[k] = np.median(spectrum[max(k - reach, 1) : k + reach + 1])
    if len(inner):
        windows = np.lib.stride_tricks.sliding_window_view(spectrum[1:], width)
        found[inner.start : inner.stop] = np.median(windows, axis=1)
    return found
