"""The torque and voltage that a fitted model lacks, read from its output error.

The error of a free run obeys the model's own linear core, driven by what the model lacks:

    f = (de/dt - A e) / g - [laws(x) - laws(x_sim)]

with the error ``e`` of the states, the gain ``g`` of the force on its own state, and the laws that
the model has.  Input, steps and transients are in the simulation and cancel, so that for a
complete model ``f`` is filtered sensor noise and nothing else.
What a small change of the base parameters would do is a linear combination of known terms and is
taken out (`orthogonal`): the rest is what no choice of base parameters can explain.
(Orthogonalised discrepancy: Plumlee 2017, doi:10.1080/01621459.2016.1211016.)

Axes and terms are simulated signals as far as possible: with measured ones each equation would
explain its own error, for what is lacking moves the current and the speed that are measured.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.drive import Drive, input_signals
from motor_sysid.physics.effect import arguments, SECOND
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors.base import Term
from motor_sysid.physics.summed import seen_by
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

WINDOW = 12
"""Samples of the (even) smoothing kernel, a Hann window."""

CERTAIN = 3.0
"""Standard deviations beyond which a smoothed error is taken for motion and not for noise."""

KERNEL = np.hanning(WINDOW + 2)[1:-1] / np.sum(np.hanning(WINDOW + 2))


@dataclass(frozen=True)
class Lack:
    """What the equations of a model lack on one record.

    Attributes
    ----------
    states:
        State or input to (N,) values: simulated, but for a speed measured where its error is
        beyond noise, and for a measured position.
    forces:
        Equation to (N,) N m or V.
    terms:
        Equation to base parameter to (N,) derivative of the lacking force by that parameter.
    """

    states: Mapping[str, Array]
    forces: Mapping[str, Array]
    terms: Mapping[str, Mapping[str, Array]]


def lack_of(
    model: Model,
    record: Record,
    predicted: Mapping[str, Array],
    measured: Mapping[str, Array] | None = None,
) -> Lack:
    """Return what a model lacks on a uniform record.

    Parameters
    ----------
    model, record:
        The model and what it was run over.
    predicted:
        Output to (N,) simulated values.
    measured:
        What to take for measured; by default the record.  With the prediction of another model
        this gives the force that tells the two models apart, free of noise.
    """
    truth = {name: (measured or record)[name] for name in predicted}
    simulated = _core_states(model, record, predicted, biased=True)
    error = _errors(model, record, predicted, truth)
    motion = {name: _beyond_noise(values) for name, values in error.items()}
    moved = {n: v + motion[n] if n in motion else v for n, v in simulated.items()}
    extra = _own_force(model, moved, simulated)
    states = model.kind.with_derived(
        {**simulated, 'omega': moved['omega']}, model.parameters.values()
    )
    forces, terms = {}, {}
    a, g = _core(model)
    for column, force in enumerate(model.kind.forces):
        row = model.kind.states.index(force.own_state)
        needed = [j for j in range(len(model.kind.states)) if a[row, j] != 0]
        if force.own_state not in error or any(model.kind.states[j] not in error for j in needed):
            continue
        pulled = sum(a[row, j] * error[model.kind.states[j]] for j in needed)
        slope = np.diff(error[force.own_state]) / record.dt
        gain = g[row, column]
        raw = (slope - _between(pulled)) / gain - _between(extra[force.name])
        forces[force.name] = smoothed(raw)
        terms[force.name] = {
            **_terms(model, force.name, states, simulated, record.dt),
            **_biases(model, a[row] / gain, len(record)),
        }
    return Lack(states, forces, terms)


def smoothed(between: Array) -> Array:
    """Smooth (N - 1,) values between samples to (N,) values at the samples."""
    total = np.convolve(between, KERNEL)
    weight = np.convolve(np.ones_like(between), KERNEL)
    first = WINDOW // 2 - 1
    result: Array = (total / weight)[first : first + between.size + 1]
    return result


@dataclass(frozen=True)
class Share:
    """What base parameters can do, over all equations and records together.

    Attributes
    ----------
    weights:
        Weight of each equation: one over the spread of what it lacks.
    basis:
        (rows, p) orthonormal; rows run over the equations and, within each, over the records.
    names:
        The equations.
    """

    weights: Mapping[str, float]
    basis: Array
    names: tuple[str, ...]

    def left(self, rows: Array) -> Array:
        """Return (rows,) or (rows, k) without the share of the base parameters."""
        left: Array = rows - self.basis @ (self.basis.T @ rows)
        return left


def share_of(lacks: Sequence[Lack]) -> Share:
    """Return what a change of the base parameters can do to what is lacking."""
    names = tuple(name for name in lacks[0].forces if all(name in one.forces for one in lacks))
    spread = {n: _spread([one.forces[n] for one in lacks]) for n in names}
    weights = {n: 1 / size if size > 0 else 1.0 for n, size in spread.items()}
    parameters = sorted({p for one in lacks for n in names for p in one.terms[n]})
    columns = [
        np.concatenate(
            [
                weights[n] * one.terms[n].get(p, np.zeros_like(one.forces[n]))
                for n in names
                for one in lacks
            ]
        )
        for p in parameters
    ]
    if not columns:
        rows = sum(one.forces[n].size for n in names for one in lacks)
        return Share(weights, np.zeros((rows, 0)), names)
    stacked = np.stack(columns, axis=1)
    size = np.linalg.norm(stacked, axis=0)
    u, s, _ = np.linalg.svd(stacked[:, size > 0] / size[size > 0], full_matrices=False)
    return Share(weights, u[:, s > 1e-6], names)


def orthogonal(lacks: Sequence[Lack], share: Share) -> list[Lack]:
    """Return what no choice of the base parameters can explain, equations taken together."""
    if not share.names:
        return list(lacks)
    names, weights = share.names, share.weights
    joined = np.concatenate([weights[n] * one.forces[n] for n in names for one in lacks])
    sizes = [one.forces[n].size for n in names for one in lacks]
    parts = iter(np.split(share.left(joined), np.cumsum(sizes)[:-1]))
    cut: list[dict[str, Array]] = [{} for _ in lacks]
    for n in names:
        for forces in cut:
            forces[n] = next(parts) / weights[n]
    return [replace(one, forces=forces) for one, forces in zip(lacks, cut, strict=True)]


def _core_states(
    model: Model, record: Record, values: Mapping[str, Array], *, biased: bool
) -> dict[str, Array]:
    """Return state to (N,) values that outputs show, and the inputs."""
    states = {}
    for output in model.kind.outputs:
        if output.signal in values:
            shift = model[output.bias] if biased and output.bias else 0.0
            states[output.state] = _on_time(model, output.signal, values[output.signal]) - shift
    if 'omega' not in states and 'theta' in states:
        states['omega'] = np.gradient(states['theta'], record.dt)
    if not biased:
        return states
    position = seen_by(model, Drive.of(record, model.kind)).position
    if position.size:
        states['theta'] = position
    inputs = [record[name] for name in input_signals(record, model.kind)]
    states.update(zip(model.kind.arguments, inputs, strict=True))
    states['t'] = record.clock
    if 'omega' in states:
        states['turn'] = record.dt * states['omega']
    return model.kind.with_derived(states, model.parameters.values())


def _errors(
    model: Model, record: Record, predicted: Mapping[str, Array], truth: Mapping[str, Array]
) -> dict[str, Array]:
    difference = {n: truth[n] - values for n, values in predicted.items()}
    return _core_states(model, record, difference, biased=False)


def _on_time(model: Model, signal: str, values: Array) -> Array:
    """Move a speed that is a difference over the last sample to the time of its sample."""
    if signal != 'speed' or model.speed_sensor is not SpeedSensor.DIFFERENCE:
        return values
    return np.append(0.5 * (values[1:] + values[:-1]), values[-1])


def _beyond_noise(error: Array) -> Array:
    """Return the smoothed error where it is beyond noise, else 0."""
    smooth = smoothed(_between(error))
    rest = error - smooth
    noise = 1.4826 * float(np.median(np.abs(rest - np.median(rest))))
    limit = CERTAIN * noise * float(np.sqrt(np.sum(KERNEL**2)))
    return np.where(np.abs(smooth) > limit, smooth, 0.0)


def _own_force(
    model: Model, states: Mapping[str, Array], simulated: Mapping[str, Array]
) -> dict[str, Array]:
    """Return what the model's laws without memory do at the states beyond what the run held."""
    size = next(iter(states.values())).size
    forces = {force.name: np.zeros(size) for force in model.kind.forces}
    laws = [model.effect(key) for key in model.effects]
    for one in (*laws, *([model.kind.own] if model.kind.own else [])):
        own = {p.name: model[f'{one.key}.{p.name}'] for p in one.card.parameters}
        for name, law in one.laws.items():
            wanted = arguments(law)
            known = {**model.parameters.values(), **own}
            force = name.removeprefix(SECOND)
            if force not in forces or any(n not in known and n not in states for n in wanted):
                continue
            now, then = (
                law(*[known[n] if n in known else place[n] for n in wanted])
                for place in (states, simulated)
            )
            forces[force] = forces[force] + (now - then)
    return forces


def _core(model: Model) -> tuple[Array, Array]:
    values = {name: np.array([v]) for name, v in model.parameters.values().items()}
    a, _, g = (matrix[0] for matrix in model.kind.matrices(values))
    return a, g


def _terms(
    model: Model,
    force: str,
    states: Mapping[str, Array],
    simulated: Mapping[str, Array],
    dt: float,
) -> dict[str, Array]:
    """Return free base parameter to the derivative of the lacking force by it."""
    free = {p.name for p in model.parameters.free}
    found: dict[str, Array] = {}
    signed = [
        (sign, term)
        for one in model.kind.balances
        if one.force == force
        for sign, term in [
            (-1.0, one.drive), *((term.sign, term) for term in (*one.terms, *one.given))
        ]
    ]
    for sign, term in signed:
        if term.parameter in free and all(n in states for n in term.signals):
            motion = simulated if term.derivative else states
            part = sign * smoothed(_signal(model, term, motion, dt))
            found[term.parameter] = found.get(term.parameter, 0.0) + part
    return found


def _signal(model: Model, term: Term, states: Mapping[str, Array], dt: float) -> Array:
    """Return (N - 1,) values between samples of a term without its parameter."""
    product = np.prod([states[n] for n in term.signals], axis=0)
    factor = float(np.prod([model[n] for n in term.factors])) if term.factors else 1.0
    return factor * (np.diff(product) / dt if term.derivative else _between(product))


def _biases(model: Model, row: Array, count: int) -> dict[str, Array]:
    """Return free sensor offset to the derivative of the lacking force by it."""
    free = {p.name for p in model.parameters.free}
    return {
        o.bias: np.full(count, row[model.kind.states.index(o.state)])
        for o in model.kind.outputs
        if o.bias in free
    }


def _between(values: Array | float) -> Array:
    array = np.asarray(values, dtype=np.float64)
    middle: Array = 0.5 * (array[1:] + array[:-1])
    return middle


def _spread(parts: Sequence[Array]) -> float:
    return float(np.std(np.concatenate(parts)))
