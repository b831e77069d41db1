"""The axes that errors and unexplained forces are looked at along."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.effect import arguments
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
Bins = NDArray[np.intp]

BINS, TURN_BINS, HEAT_BINS = 24, 72, 8
MAP_COLUMNS, MAP_ROWS = 14, 10

OWN_TIME, INPUT = 'time in the recording', 'input'

FAR = 'position across turns'

FAR_TRAVEL = 1.5
"""Turns of travel from which on what repeats over more than a turn is looked for."""

HEAT = 'q'
"""Own state of effects of temperature: the loss energy that the winding holds."""

RESTING = 0.01
"""Share of the top speed below which a motor has no direction."""

REACH = 0.995
"""Quantile of the size of speed and current at which their axes end."""


@dataclass(frozen=True)
class Axis:
    """One axis with its bins.

    Attributes
    ----------
    name, unit:
        ``speed``, ``direction``, ``current``, ``input``, ``position``, ``time`` or
        ``temperature``.
    values:
        For each record (N,) values.
    edges:
        (B + 1,) edges; what lies outside belongs to the outermost bins.
    """

    name: str
    unit: str
    values: tuple[Array, ...]
    edges: Array

    @property
    def count(self) -> int:
        """Number of bins."""
        return self.edges.size - 1

    def places(self) -> tuple[Bins, ...]:
        """Return for each record the (N,) bin of each sample; -1 where there is no value."""
        return tuple(
            np.where(
                np.isfinite(v), np.clip(np.digitize(v, self.edges) - 1, 0, self.count - 1), -1
            )
            for v in self.values
        )


def axes_of(
    model: Model, records: Sequence[Record], states: Sequence[Mapping[str, Array]]
) -> dict[str, Axis]:
    """Return the axes of uniform records, given what is known of their motion.

    Position is taken within one turn; temperature is a measured one, or the loss energy that the
    winding holds where the model has heating.
    """
    length = 'm' if model.linear else 'rad'
    speeds = tuple(s['omega'] for s in states)
    top = _reach(speeds)
    moving = tuple(np.sign(np.where(np.abs(v) < RESTING * top, 0.0, v)) for v in speeds)
    axes = [
        Axis('speed', f'{length}/s', speeds, top * np.linspace(-1, 1, BINS + 1)),
        Axis('direction', '1', moving, np.array([-1.5, -0.5, 0.5, 1.5])),
    ]
    if all('theta' in s for s in states):
        axes.append(_position(model, tuple(s['theta'] for s in states)))
    drawn = next((n for n in ('i', 'i_q') if all(n in s for s in states)), '')
    if drawn:
        axes.append(_signed('current', 'A', tuple(s[drawn] for s in states)))
    axes.append(_clock(records))
    heat = _heat(model, records, states)
    known = {axis.name: axis for axis in (*axes, *heat)}
    return known if drawn else {**known, **driven(model, records, states)}


def driven(
    model: Model, records: Sequence[Record], states: Sequence[Mapping[str, Array]]
) -> dict[str, Axis]:
    """Return the input as an axis, where there is one: what a drive does to it goes with it."""
    if not all('u' in s for s in states):
        return {}
    unit = records[0].units[input_signals(records[0], model.kind)[0]]
    return {INPUT: _signed(INPUT, unit, tuple(s['u'] for s in states))}


def _position(model: Model, angles: tuple[Array, ...]) -> Axis:
    if not model.linear:
        turn = 2 * np.pi
        turns = tuple(np.mod(angle, turn) for angle in angles)
        return Axis('position', 'rad', turns, np.linspace(0.0, turn, TURN_BINS + 1))
    low, high = min(a.min() for a in angles), max(a.max() for a in angles)
    return Axis('position', 'm', angles, _spaced(low, high, TURN_BINS))


def _signed(name: str, unit: str, values: tuple[Array, ...]) -> Axis:
    reach = _reach(values)
    return Axis(name, unit, values, reach * np.linspace(-1, 1, BINS + 1))


def _clock(records: Sequence[Record]) -> Axis:
    """Return the time over all records, one after the other."""
    ends = np.cumsum([0.0, *(r.duration + r.dt for r in records)])
    clocks = tuple(r.time - r.time[0] + begin for r, begin in zip(records, ends, strict=False))
    return Axis('time', 's', clocks, _spaced(0.0, float(ends[-1]), BINS))


def own_time(records: Sequence[Record]) -> dict[str, Axis]:
    """Return the time within each recording as an axis, where there are several recordings.

    Stretches of one recording keep its clock.
    """
    begins: dict[str, float] = {}
    for r in records:
        source = r.provenance.source
        begins[source] = min(begins.get(source, np.inf), float(r.time[0]))
    clocks = tuple(r.time - begins[r.provenance.source] for r in records)
    if len(records) < 2 or all(a[-1] <= b[0] for a, b in pairwise(clocks)):
        return {}
    end = max(float(clock[-1]) for clock in clocks)
    return {OWN_TIME: Axis(OWN_TIME, 's', clocks, _spaced(0.0, end, BINS))}


def many_turns(model: Model, states: Sequence[Mapping[str, Array]]) -> dict[str, Axis]:
    """Return the position over the whole travel as an axis, where a rotor turns on."""
    if model.linear or not all('theta' in s for s in states):
        return {}
    angles = tuple(s['theta'] for s in states)
    low, high = min(a.min() for a in angles), max(a.max() for a in angles)
    if high - low < FAR_TRAVEL * 2 * np.pi:
        return {}
    return {FAR: Axis(FAR, 'rad', angles, _spaced(low, high, TURN_BINS))}


def _heat(
    model: Model, records: Sequence[Record], states: Sequence[Mapping[str, Array]]
) -> list[Axis]:
    if all('temperature' in r for r in records):
        warmth = tuple(r['temperature'] for r in records)
        unit = records[0].units['temperature']
    else:
        key = next((k for k in model.effects if effect(k).card.states == (HEAT,)), '')
        if not key:
            return []
        warmth = tuple(_stored(model, key, s) for s in states)
        unit = 'J'
    low, high = min(w.min() for w in warmth), max(w.max() for w in warmth)
    return [Axis('temperature', unit, warmth, _spaced(low, high, HEAT_BINS))]


def _stored(model: Model, key: str, states: Mapping[str, Array]) -> Array:
    """Return the (N,) loss energy in J that a winding holds, from a cold start."""
    rate = model.effect(key).rates[HEAT]
    wanted = arguments(rate)
    known = {p.name.removeprefix(f'{key}.'): p.value for p in model.parameters}
    columns = [
        np.broadcast_to(states[n] if n in states else known.get(n, 0.0), states['t'].shape)
        for n in wanted
    ]
    place = list(wanted).index(HEAT)
    held, path = 0.0, np.zeros(states['t'].size)
    steps = np.diff(states['t'])
    for k, row in enumerate(zip(*(c[:-1].tolist() for c in columns), strict=True)):
        held += float(rate(*row[:place], held, *row[place + 1 :])) * steps[k]
        path[k + 1] = held
    return path


def _spaced(low: float, high: float, count: int) -> Array:
    room = 1e-9 * max(abs(low), abs(high), 1.0)
    edges: Array = np.linspace(low, high + room, count + 1)
    return edges


def _reach(parts: Sequence[Array]) -> float:
    return float(np.quantile(np.abs(np.concatenate(parts)), REACH)) or 1.0
