"""The equation errors that the peers work on: both balances, with a term for each effect.

Voltage balance ``u = R i + L di/dt + k omega + c + ...`` and torque balance
``k i = J domega/dt + b omega + ...`` are linear in the base parameters and in the amplitudes of
effects.  Every column passes the same Savitzky-Golay filter, derivatives come from it, and one row
in a window is kept, so that rows are nearly independent (as in the IDIM-LS method: Gautier, Janot
and Vandanjon, IEEE Trans. Control Syst. Technol. 21 (2013)).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from motor_sysid.diagnosis.candidates.matched_filter import Matched
from motor_sysid.diagnosis.search.bench import base_fit, make_bench
from motor_sysid.diagnosis.where.equation_errors import known_forces, measured_states
from motor_sysid.errors import UserError
from motor_sysid.estimation.batch import Problem
from motor_sysid.physics.effect import Card
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motor
from motor_sysid.physics.scales import Scales, scales_of
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

WINDOW, DEGREE = 21, 3
UNSTARTED = 5
"""Starts of a shape whose card names none."""


@dataclass(frozen=True)
class Term:
    """One effect with one shape.

    Attributes
    ----------
    effect:
        Its key.
    columns:
        Equation to (N, K) columns, one for each amplitude.
    """

    effect: str
    columns: Mapping[str, Array]


@dataclass(frozen=True)
class Equations:
    """Both balances.

    Attributes
    ----------
    target:
        Equation (``voltage``, ``torque``) to (N,) left-hand side.
    base:
        Equation to (N, K) columns of the base parameters.
    terms:
        What may be added.
    """

    target: Mapping[str, Array]
    base: Mapping[str, Array]
    terms: tuple[Term, ...]


def equations(records: Sequence[Record], effects: Sequence[str]) -> Equations:
    """Set up the balances of a brushed DC motor with a term for each effect that they can hold."""
    evens = [record.uniform() for record in records]
    model = _rough_model(evens)
    states = [_states(model, record) for record in evens]
    rows = [_smooth(s, r.dt) for s, r in zip(states, evens, strict=True)]
    one = np.ones(sum(row['i'].size for row in rows))
    joined = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
    k, offset = _torque_constant(joined, one)
    return Equations(
        target={'voltage': joined['u'], 'torque': k * (joined['i'] - offset)},
        base={
            'voltage': np.column_stack([joined['i'], joined['di'], joined['omega'], one]),
            'torque': np.column_stack([joined['domega'], joined['omega']]),
        },
        terms=tuple(_terms(model, effects, evens, states)),
    )


def _rough_model(records: Sequence[Record]) -> Model:
    kind = motor('brushed_dc')
    boxes = {p.name: p for p in kind.parameters}
    values = {
        name: float(np.clip(value, boxes[name].lower, boxes[name].upper))
        for name, value in kind.start(records, {}).items()
    }
    late = 'position' in records[0]
    sensor = SpeedSensor.DIFFERENCE if late else SpeedSensor.IDEAL
    return Model.base('brushed_dc', values, speed_sensor=sensor)


def _states(model: Model, record: Record) -> dict[str, Array]:
    """Return measured states, inputs and slopes, (N,) each."""
    states = measured_states(model, record)
    if 'theta' not in states:
        states['theta'] = np.cumsum(states['omega']) * record.dt
    slopes = {
        f'd{name}': savgol_filter(states[name], WINDOW, DEGREE, deriv=1, delta=record.dt)
        for name in ('i', 'omega')
    }
    return {**states, **slopes}


def _smooth(columns: Mapping[str, Array], dt: float) -> dict[str, Array]:
    """Filter every column but the slopes, which are filtered, and keep one row in a window."""
    return {
        name: (values if name in ('di', 'domega') else savgol_filter(values, WINDOW, DEGREE))[
            WINDOW // 2 :: WINDOW
        ]
        for name, values in columns.items()
    }


def _torque_constant(joined: Mapping[str, Array], one: Array) -> tuple[float, float]:
    """Return torque constant, N m/A, and offset of the current sensor, A, of the base balance."""
    base = np.column_stack([joined['i'], joined['di'], joined['omega'], one])
    r, _, k, c = np.linalg.lstsq(base, joined['u'], rcond=None)[0]
    return float(k), float(-c / r)


def _terms(
    model: Model,
    effects: Sequence[str],
    records: Sequence[Record],
    states: Sequence[Mapping[str, Array]],
) -> Iterator[Term]:
    scales = scales_of('brushed_dc', model.parameters.values(), records)
    orders = _orders(records, effects)
    for key in effects:
        card = effect(key).card
        for shapes in _shapes(card, scales, orders.get(key, ())):
            columns = _columns(model, key, shapes, scales, states, records)
            if columns:
                yield Term(key, columns)


def _orders(records: Sequence[Record], effects: Sequence[str]) -> dict[str, tuple[int, ...]]:
    """Return for each effect with waves per turn those that the diagnosis would try, too."""
    waving = [key for key in effects if effect(key).card.orders]
    if not waving:
        return {}
    bench = make_bench(records, (), motor('brushed_dc'))
    model = base_fit(records, bench.kind, bench.train, bench.outputs, {}).model
    problem = Problem(model, bench.train, bench.outputs)
    matched = Matched(problem, problem.linearize(problem.vector()))
    return {key: matched.orders(effect(key)) for key in waving}


def _shapes(card: Card, scales: Scales, orders: Sequence[int]) -> Iterator[dict[str, float]]:
    """Yield a value for each shape, in every combination of starts."""
    choices = []
    for shape in card.shapes:
        if shape.name == card.orders:
            choices.append([float(n) for n in orders])
        elif shape.starts:
            choices.append([s * scales.size(shape.scale) for s in shape.starts])
        else:
            grid = np.linspace(shape.lower, shape.upper, UNSTARTED + 2)[1:-1]
            choices.append((grid * scales.size(shape.scale)).tolist())
    for values in product(*choices):
        yield dict(zip([shape.name for shape in card.shapes], values, strict=True))


def _columns(
    model: Model,
    key: str,
    shapes: dict[str, float],
    scales: Scales,
    states: Sequence[Mapping[str, Array]],
    records: Sequence[Record],
) -> dict[str, Array]:
    """Return the columns of an effect: what each amplitude adds, its typical size as unit."""
    card = effect(key).card
    found: dict[str, list[Array]] = {}
    for amplitude in card.amplitudes:
        size = (amplitude.trials or (1.0,))[0] * scales.size(amplitude.scale)
        if card.delay:
            found.setdefault('voltage', []).append(_late(states, records, size))
            continue
        try:
            added = model.with_effect(key, {**shapes, amplitude.name: size})
        except UserError:  # this motor cannot have it
            return {}
        for name, column in _forces(added, states, records).items():
            found.setdefault(name, []).append(column)
    return {name: np.column_stack(columns) for name, columns in found.items()}


def _forces(
    model: Model, states: Sequence[Mapping[str, Array]], records: Sequence[Record]
) -> dict[str, Array]:
    """Return what a model's effects add to each equation, filtered, where that is not zero."""
    parts: dict[str, list[Array]] = {}
    for state, record in zip(states, records, strict=True):
        for name, values in _smooth(known_forces(model, state), record.dt).items():
            parts.setdefault(name, []).append(values)
    joined = {name: np.concatenate(values) for name, values in parts.items()}
    return {
        name: values
        for name, values in joined.items()
        if np.all(np.isfinite(values)) and np.any(values)
    }


def _late(
    states: Sequence[Mapping[str, Array]], records: Sequence[Record], delay: float
) -> Array:
    """Return what a small delay takes from the voltage: its slope times the delay."""
    slopes = [
        delay * savgol_filter(s['u'], WINDOW, DEGREE, deriv=1, delta=r.dt)[WINDOW // 2 :: WINDOW]
        for s, r in zip(states, records, strict=True)
    ]
    return np.concatenate(slopes)
