"""Values that the data propose for shapes that no list of starts could cover.

Moments are looked for in the unexplained force, where the gain of a law that sets in at any moment
is one pass over the data; waves per turn and frequencies by a matched filter
(`motor_sysid.diagnosis.candidates.matched_filter`), and both in the unexplained force, too.
What stands out is then tried in simulation like any other start.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.candidates.matched_filter import (
    carrier_of,
    clearest_line,
    fewest,
    highest,
    law_along,
    Matched,
    TOP_ORDER,
)
from motor_sysid.diagnosis.candidates.reference_rhythm import Rhythms
from motor_sysid.diagnosis.candidates.turns import add_energy, add_waves, by_length
from motor_sysid.diagnosis.where.equation_errors import (
    measured_states,
    rates_of,
    unexplained,
)
from motor_sysid.estimation.batch import Linearization, Problem
from motor_sysid.physics.effect import Effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.scales import Scales
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

MOMENTS, FREQUENCIES, ORDERS = 2, 3, 4
"""How many of each are tried; of orders up to four more, see `Matched` and `_turning`."""

PROUD = 15.0
"""How much more of an unexplained force than its neighbours a number of waves per turn must
explain to be tried: in white noise one of 400 numbers does so in 12 records of 100."""

CLIPPED = 5.0
"""Largest unexplained force that counts, in units of its median: 3.4 standard deviations."""

_GRID = 2000
_APART = 0.05
_EDGE = 0.02


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
    problem: Problem,
    near: Sequence[Linearization],
    records: Sequence[Record],
    effects: Sequence[Effect],
    scales: Scales,
) -> dict[str, tuple[float, ...]]:
    """Return key to values of the searched shape, of every effect that has one.

    Parameters
    ----------
    problem, near:
        The fitted model and the training data, and its residuals and derivatives there.
    records:
        Training records.
    effects:
        Candidates.
    scales:
        Typical sizes.
    """
    model = problem.model
    matched = cache(lambda: Matched(problem, near))
    plain = cache(lambda: Matched(problem, near, plain=True))
    rhythms = cache(lambda: Rhythms(records))
    lacks = cache(lambda force: _lacks(model, records, force))
    found: dict[str, tuple[float, ...]] = {}
    for one in map(model.kind.taking, effects):
        card = one.card
        if not model.lacks(one):
            continue
        force = next((f.name for f in model.kind.forces if f.name in one.laws), '')
        if not force or not (card.orders or card.moment or card.frequency):
            continue
        if card.orders:
            there = _waves(model, one)
            most, clearest = matched().orders(one, ORDERS), matched().clearest(one)
            lacking = _turning(one, force, lacks(force), scales)
            orders = dict.fromkeys((*most, *clearest, *plain().orders(one, 1), *lacking))
            found[one.key] = tuple(float(n) for n in orders if not {n, 2 * n} & there)
        if card.moment:
            found[one.key] = _moments(one, force, lacks(force), scales)
        elif card.frequency:
            likely = (matched().frequencies(force, 4 * FREQUENCIES), plain().frequencies(force, 4))
            own = [[f for f in some if not rhythms().has(f)] for some in likely]
            pieces = len(problem.stretches) > len(records)
            lines = _swinging(lacks(force)) if pieces else ()
            swings = (f for f in lines if not rhythms().has(f))
            found[one.key] = tuple(dict.fromkeys((*own[0][:FREQUENCIES], *own[1][:1], *swings)))
    return found


def _turning(
    one: Effect, force: str, lacks: Sequence[_Lack], scales: Scales
) -> tuple[int, ...]:
    """Return the waves per turn that stand out most of an unexplained force, if any do.

    What bends a slow motion only, and that much, is in the output error a slow wave at times,
    which the noise model of the matched filter takes for noise.  Single large forces, as where the
    motor stalls, count no more than others.
    """
    total, energy = np.zeros(TOP_ORDER + 1, complex), np.zeros(TOP_ORDER + 1)
    turning = [
        (lack, carrier) for lack in lacks if 'theta' in lack.known
        and (carrier := carrier_of(one, force, lack.known, scales, lack.time.size)) is not None
    ]  # fmt: skip
    if not turning:
        return ()
    size = CLIPPED * float(np.median(np.abs(np.concatenate([lack.force for lack, _ in turning]))))
    for lack, carrier in turning:
        theta, step = np.asarray(lack.known['theta']), np.abs(np.asarray(lack.known['turn']))
        add_waves(theta, step, np.clip(lack.force, -size, size) * carrier, total)
        add_energy(*by_length(step, carrier**2), np.ones(2), energy)
    with np.errstate(over='ignore', invalid='ignore'):  # laws may run away on what is measured
        gains = np.abs(total) ** 2 / np.maximum(energy, 1e-300)
    if not np.all(np.isfinite(gains)):
        return ()
    return highest(gains, fewest(one), PROUD)[:2]


def _swinging(lacks: Sequence[_Lack]) -> tuple[float, ...]:
    """Return the frequency in Hz of the clearest line of the unexplained force, if there is one.

    Where the model is run over many short pieces, a load sets in anew with each, and in the output
    error slow waves at other frequencies look much like it.
    """
    longest = max(lacks, key=lambda lack: lack.time.size, default=None)
    return () if longest is None else clearest_line(longest.force, longest.dt)


def _waves(model: Model, one: Effect) -> set[int]:
    """Return the waves per turn, with their doubles, that the model has by the same law."""
    same = [key for key in model.effects if model.effect(key).source == one.source]
    orders = {round(model[f'{key}.{one.card.orders}']) for key in same}
    return orders | {2 * n for n in orders}


def _lacks(model: Model, records: Sequence[Record], force: str) -> list[_Lack]:
    """Prepare the records in which that force can be reckoned."""
    lacks = []
    for record in records:
        even = record.uniform()
        with np.errstate(over='ignore', invalid='ignore'):  # laws may run away on what is measured
            lacking = unexplained(model, even).get(force)
        if lacking is None or not np.all(np.isfinite(lacking)):
            continue
        states = measured_states(model, even)
        states.update(rates_of(model, states, even.dt))
        time = even.clock
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
    settling = [
        (lack, column) for lack in lacks
        if (column := _column(one, force, lack, scales)) is not None
    ]  # fmt: skip
    if not settling:
        return ()
    end = max(float(lack.time[-1]) for lack, _ in settling)
    moments = np.linspace(_EDGE * end, (1 - _EDGE) * end, _GRID)
    along, size = np.zeros(_GRID), np.full(_GRID, 1e-300)
    for lack, column in settling:
        place = np.minimum(np.searchsorted(lack.time, moments), column.size)
        along += _from_end(column * lack.force)[place]
        shared = _from_end(column[:, np.newaxis] * lack.basis)[place]
        size += _from_end(column**2)[place] - np.sum(shared**2, axis=1)
    with np.errstate(over='ignore', invalid='ignore'):  # laws may run away on what is measured
        gain = along**2 / np.maximum(size, 1e-300)
    gain[size <= 1e-6 * np.max(size)] = 0.0
    chosen: list[float] = []
    for k in np.argsort(-gain).tolist():
        if gain[k] <= 0.0 or len(chosen) == MOMENTS:
            break
        if all(abs(moments[k] - other) > _APART * end for other in chosen):
            chosen.append(float(moments[k]))
    return tuple(chosen)


def _column(one: Effect, force: str, lack: _Lack, scales: Scales) -> Array | None:
    """Return (N,) the law at its first amplitude of one, as if it had begun long ago.

    None where it asks for more than is known.
    """
    chosen = {one.card.amplitudes[0].name: 1e-3, one.card.moment: -1e6}
    column = law_along(one, force, lack.known, scales, chosen, lack.time.size)
    return None if column is None else 1e3 * column


def _from_end(values: Array) -> Array:
    """Return (N + 1, ...) sums of all values from each place to the end."""
    total = np.zeros((values.shape[0] + 1, *values.shape[1:]))
    total[:-1] = np.cumsum(values[::-1], axis=0)[::-1]
    return total
