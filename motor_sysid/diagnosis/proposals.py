"""Values that the data propose for shapes that no list of starts could cover.

Moments and frequencies are looked for in the unexplained force, where each is one pass over the
data: a spectrum over time, or the gain of a law that sets in at any moment.  Waves per turn are
looked for by simulation (`motor_sysid.diagnosis.orders`).  What stands out is then tried in
simulation like any other start.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import inspect

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.orders import likely_orders
from motor_sysid.diagnosis.residual import (
    measured_states,
    rates_of,
    surroundings,
    unexplained,
)
from motor_sysid.estimation.batch import Problem
from motor_sysid.physics.effect import Effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.scales import Scales
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

MOMENTS, FREQUENCIES = 2, 3
"""How many of each are tried."""

_GRID = 2000
_APART = 0.05
_EDGE = 0.02
_HEIGHT = 8.0
_CYCLES = 1.5
_HIGHEST = 0.4
_NEIGHBOURS = 40


@dataclass(frozen=True)
class _Lack:
    """One record: time from its start (N,), sample time, unexplained force (N,), what is known.

    `basis` (N, q) spans what the motor's own parameters could still explain; the force is free of
    it.  `known` is every name that a law may ask for.
    """

    time: Array
    dt: float
    force: Array
    basis: Array
    known: Mapping[str, Array | float]


def proposals(
    problem: Problem, records: Sequence[Record], effects: Sequence[Effect], scales: Scales
) -> dict[str, tuple[float, ...]]:
    """Return key to values of the searched shape, of every effect that has one.

    Parameters
    ----------
    problem:
        The fitted model and some of the data, for what is looked for by simulation.
    records:
        Training records.
    effects:
        Candidates.
    scales:
        Typical sizes.
    """
    model = problem.model
    found: dict[str, tuple[float, ...]] = {}
    lacks: dict[str, list[_Lack]] = {}
    for one in effects:
        card = one.card
        if one.key in model.effects or not model.admits(one):
            continue
        if card.orders:
            found[one.key] = tuple(float(n) for n in likely_orders(problem, one))
        if not card.moment and not card.frequency:
            continue
        force = next(f.name for f in model.kind.forces if f.name in one.laws)
        if force not in lacks:
            lacks[force] = _lacks(model, records, force)
        if card.moment:
            found[one.key] = _moments(one, force, lacks[force], scales)
        else:
            found[one.key] = _frequencies(lacks[force])
    return found


def _lacks(model: Model, records: Sequence[Record], force: str) -> list[_Lack]:
    """Prepare the records in which that force can be reckoned."""
    lacks = []
    for record in records:
        even = record.uniform()
        lacking = unexplained(model, even).get(force)
        if lacking is None:
            continue
        states = measured_states(model, even)
        states.update(rates_of(model, states, even.dt))
        time = even.time - even.time[0]
        states['t'] = time
        columns = [v for n, v in states.items() if n not in ('t', 'theta', 'turn')]
        width = model['omega_eps']
        columns += [np.ones(time.size), np.clip(states['omega'] / width, -1.0, 1.0)]
        basis, _ = np.linalg.qr(np.column_stack(columns))
        rest = lacking - basis @ (basis.T @ lacking)
        known: dict[str, Array | float] = {**model.parameters.values(), **states}
        lacks.append(_Lack(time, even.dt, rest, basis, known))
    return lacks


def _moments(
    one: Effect, force: str, lacks: Sequence[_Lack], scales: Scales
) -> tuple[float, ...]:
    """Return the moments from which on the law would explain most, best first.

    The law's column is what it would be from the start, cut off before the moment; so sums from
    the end give the gain of every moment at once.
    """
    if not lacks:
        return ()
    end = max(float(lack.time[-1]) for lack in lacks)
    moments = np.linspace(_EDGE * end, (1 - _EDGE) * end, _GRID)
    along, size = np.zeros(_GRID), np.full(_GRID, 1e-300)
    for lack in lacks:
        column = _column(one, force, lack, scales)
        place = np.minimum(np.searchsorted(lack.time, moments), column.size)
        along += _from_end(column * lack.force)[place]
        shared = _from_end(column[:, np.newaxis] * lack.basis)[place]
        size += _from_end(column**2)[place] - np.sum(shared**2, axis=1)
    gain = np.where(size > 1e-6 * np.max(size), along**2 / size, 0.0)
    chosen: list[float] = []
    for k in np.argsort(-gain).tolist():
        if gain[k] <= 0.0 or len(chosen) == MOMENTS:
            break
        if all(abs(moments[k] - other) > _APART * end for other in chosen):
            chosen.append(float(moments[k]))
    return tuple(chosen)


def _column(one: Effect, force: str, lack: _Lack, scales: Scales) -> Array:
    """Return (N,) the law at its first amplitude of one, as if it had begun long ago."""
    card = one.card
    known: dict[str, Array | float] = {**lack.known}
    known.update({a.name: 0.0 for a in card.amplitudes})
    known.update({s.name: s.starts[0] * scales.size(s.scale) for s in card.shapes if s.starts})
    known[card.amplitudes[0].name] = 1e-3
    known[card.moment] = -1e6
    law = one.laws[force]
    values = law(*[known[n] for n in inspect.signature(law).parameters])
    column: Array = 1e3 * np.broadcast_to(values, lack.time.shape)
    return column


def _from_end(values: Array) -> Array:
    """Return (N + 1, ...) sums of all values from each place to the end."""
    total = np.zeros((values.shape[0] + 1, *values.shape[1:]))
    total[:-1] = np.cumsum(values[::-1], axis=0)[::-1]
    return total


def _frequencies(lacks: Sequence[_Lack]) -> tuple[float, ...]:
    """Return the frequencies in Hz that stand out of the unexplained force, strongest first.

    Its spectrum, at half the resolution's spacing, is divided by the median of its surroundings.
    """
    if not lacks:
        return ()
    end = max(float(lack.time[-1]) for lack in lacks)
    spacing = 0.5 / end
    count = int(_HIGHEST / max(lack.dt for lack in lacks) / spacing)
    power = np.zeros(count)
    for lack in lacks:
        window = np.hanning(lack.time.size)
        length = max(round(1.0 / (spacing * lack.dt)), lack.time.size)
        spectrum = np.abs(np.fft.rfft(window * lack.force, length)) ** 2
        at = np.arange(count) * spacing * length * lack.dt
        power += np.interp(at, np.arange(spectrum.size), spectrum)
    first = int(np.ceil(_CYCLES / end / spacing))
    height = power / (surroundings(power, _NEIGHBOURS) + 1e-300)
    peak = np.zeros(count, dtype=bool)
    peak[1:-1] = (power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:])
    peak[:first] = False
    best = [k for k in np.argsort(-height * peak).tolist() if peak[k] and height[k] > _HEIGHT]
    return tuple(_summit(power, k) * spacing for k in best[:FREQUENCIES])


def _summit(power: Array, k: int) -> float:
    """Return the place of the peak of a parabola through the logarithms around `k`."""
    left, middle, right = np.log(power[k - 1 : k + 2] + 1e-300)
    bend = left - 2 * middle + right
    return float(k + (0.5 * (left - right) / bend if bend < 0 else 0.0))
