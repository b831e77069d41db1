"""The columns that the effects of a model add to its equations, or to what its sensors show.

A law is linear in its amplitudes: its regressors are its values with one amplitude at one and the
others at zero.  Each of them is one lane of the compiled law (see `motor_sysid.physics.lanes`), so
that one call gives them all.  (An amplitude that comes with values to try is not linear: it is
held.)
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept
from motor_sysid.physics.buffer import call_all, evaluate_rates
from motor_sysid.physics.effect import Effect
from motor_sysid.physics.lanes import (
    compile_effect,
    FIRST_PARAMETER_ROW,
    Lane,
    LANES,
    ROW_OF_ARGUMENT,
    ROW_OF_FORCE,
)
from motor_sysid.physics.model import Model
from motor_sysid.physics.native import as_pointer, rows
from motor_sysid.physics.own_states import correct_own, predict_own
from motor_sysid.physics.vector import put, spread, WIDTH

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

_ABSURD = 1e12
_SHOWN = 1.0
"""Time constant with which a sensor shows the state of its filter, even one of no time."""
_TARGET, _WIDTH = 3, 4


class Column(NamedTuple):
    """One column: its free amplitude as a parameter of the model, and the target of its law.

    Without a name it is what the law gives for the amplitudes that are held.
    """

    name: str
    target: str


def own_states(model: Model) -> tuple[str, ...]:
    """Return the own states of a model's effects, ``effect_key.symbol``, in their order."""
    cards = [(key, model.effect(key).card) for key in model.effects]
    return tuple(f'{key}.{state}' for key, card in cards for state in card.states)


class LawColumns:
    """The columns of all effects with a law for one of the targets.

    Parameters
    ----------
    model:
        The model; laws are given its parameters, but for their free amplitudes (see `give`).
    targets:
        Names of equations or sensors.
    signals:
        Names of the first entries of the vectors of signals that the laws will be given; own
        states that are among them (see `own_states`) are read there.
    memory:
        Whether laws of effects with other own states take part.

    Attributes
    ----------
    columns:
        What each column is: for each law its free amplitudes, then what is held.
    needs:
        States and inputs that the laws and the rates of their own states read.
    table:
        What the compiled functions of this module take: memory of the laws (a buffer as
        `motor_sysid.physics.lanes` describes it) and its address; (L, 5) addresses of the laws,
        where their parameters, own states and results lie, and how many columns they fill;
        (R, 2) rows of the buffer and the entries of the signals that belong there.
    """

    def __init__(
        self, model: Model, targets: Sequence[str], signals: Sequence[str], memory: bool = True
    ) -> None:
        motor = [p.name for p in model.kind.parameters]
        self._rows = [np.zeros(LANES)] * FIRST_PARAMETER_ROW
        self._start: list[tuple[str, int, float]] = []
        self._own_rows: dict[str, int] = {}
        self._add_given(model, motor)
        self._calls: list[tuple[int, ...]] = []
        self._rates: list[tuple[Lane, int, int, int]] = []
        self._begin_at: list[tuple[int, str]] = []
        self._keep: list[Lane] = []
        self.columns: tuple[Column, ...] = ()
        self.needs: set[str] = set()
        for one in map(model.effect, model.effects):
            told = {f'{one.key}.{state}' for state in one.card.states} <= set(signals)
            if set(targets) & set(one.laws) and (memory or told):
                self._add(model, one, targets, compile_effect(one, tuple(motor)))
                self.needs |= one.needs() - {*model.parameters.values(), 't', 'turn'}
        self._add_shown(model, targets, motor)
        buffer = np.concatenate(self._rows)
        calls = np.array(self._calls, dtype=np.int64).reshape(-1, 5)
        rows = ROW_OF_ARGUMENT | self._own_rows
        reads = [(rows[s], k) for k, s in enumerate(signals) if s in rows]
        self.table = (
            buffer, buffer.ctypes.data, calls,
            np.array(reads, dtype=np.int64).reshape(-1, 2),
        )  # fmt: skip
        self._begins = [(offset, list(signals).index(core)) for offset, core in self._begin_at]
        self._own = self._own_states()

    def _add(
        self, model: Model, one: Effect, targets: Sequence[str], lanes: Sequence[Lane]
    ) -> None:
        """Give an effect its rows: its parameters as they are, its own states, its columns."""
        free = [
            p.name for p in one.card.amplitudes
            if not p.trials and model.parameters[f'{one.key}.{p.name}'].free
        ]  # fmt: skip
        plain = len(self._rows) * LANES
        self._add_given(model, [f'{one.key}.{p.name}' for p in one.card.parameters])
        state = len(self._rows) * LANES
        for k, name in enumerate(one.card.states):
            self._own_rows[f'{one.key}.{name}'] = len(self._rows) + k
        self._rows += [np.zeros(LANES)] * (2 * len(one.card.states))
        self._keep += lanes
        self._begin_at += [
            (state + one.card.states.index(mine) * LANES, core)
            for mine, core in one.card.begins.items()
        ]
        for lane in lanes:
            if lane.target in targets:
                self.columns += tuple(Column(f'{one.key}.{n}', lane.target) for n in free)
                self.columns += (Column('', lane.target),)
                self._add_columns(model, one, lane, free, state)
            elif lane.target in one.card.states:
                self._rates.append((lane, plain, state, len(one.card.states)))

    def _add_given(self, model: Model, names: Sequence[str]) -> None:
        """Add rows of parameters as they are, which `give` renews."""
        first = len(self._rows)
        self._start += [(name, first + k, model[name]) for k, name in enumerate(names)]
        self._rows += [np.full(LANES, model[name]) for name in names]

    def _add_shown(self, model: Model, targets: Sequence[str], motor: Sequence[str]) -> None:
        """Add the laws of the motor's own sensors, one column for each parameter of theirs.

        Its own laws that read none of these are in its balances already: as columns they would be
        the same signals once more, and two parameters could not be told apart.
        """
        own, names = model.kind.own, model.kind.shown
        if own is None or not names or not set(targets) & set(own.laws):
            return
        for k, name in enumerate(names):
            row = np.zeros(LANES)
            row[k] = 1.0
            self._rows[FIRST_PARAMETER_ROW + motor.index(name)] = row
        self._start = [one for one in self._start if one[0] not in names]
        for lane in compile_effect(own, tuple(motor)):
            if lane.target in targets and lane.arguments & set(names):
                self._keep.append(lane)
                self.columns += tuple(Column(name, lane.target) for name in names)
                target = ROW_OF_FORCE[lane.target] * LANES
                self._calls.append((lane.address, 0, 0, target, len(names)))

    def _add_columns(
        self, model: Model, one: Effect, lane: Lane, free: Sequence[str], state: int
    ) -> None:
        """Give a law parameters of its own for each column, 32 columns to a call."""
        linear = [p.name for p in one.card.amplitudes if not p.trials]
        width = len(free) + 1
        blocks = -(-width // LANES)
        table = np.zeros((len(one.card.parameters), blocks * LANES))
        for row, p in zip(table, one.card.parameters, strict=True):
            if p.name in free:
                row[free.index(p.name)] = 1.0
            else:
                value = _SHOWN if p.name == one.card.filter else model[f'{one.key}.{p.name}']
                row[width - 1 if p.name in linear else slice(None)] = value
        for k in range(blocks):
            own = len(self._rows) * LANES
            self._rows += list(table[:, k * LANES : (k + 1) * LANES])
            target = ROW_OF_FORCE[lane.target] * LANES
            count = min(width - k * LANES, LANES)
            self._calls.append((lane.address, own, state, target, count))

    def _own_states(self) -> tuple[Integers, NDArray[np.bool_], Integers, Integers]:
        """Return calls, whether they fade, values and rates; see `predict_own`."""
        names = [lane.target for lane, *_ in self._rates]
        firsts = [state for _, _, state, _ in self._rates]
        at = [firsts[:k].count(state) * LANES for k, state in enumerate(firsts)]
        calls = np.array(
            [(lane.address, own, state) for lane, own, state, _ in self._rates], dtype=np.int64
        ).reshape(-1, 3)
        fades = [name in r[0].arguments for name, r in zip(names, self._rates, strict=True)]
        values = np.array(firsts, dtype=np.int64) + np.array(at, dtype=np.int64)
        rates = values + LANES * np.array([r[3] for r in self._rates], dtype=np.int64)
        return calls, np.array(fades, dtype=np.bool_), values, rates

    def give(self, values: Mapping[str, float]) -> None:
        """Have laws read these values of parameters, those of the model where there are none."""
        table = self.table[0].reshape(-1, LANES)
        for name, row, value in self._start:
            table[row] = values.get(name, value)

    def begin(self, signals: Array) -> None:
        """Give own states that follow a state of the motor its value in the signals (S,)."""
        for offset, place in self._begins:
            self.table[0][offset : offset + LANES] = signals[place]

    def advance(self, h: float) -> None:
        """Carry own states on by `h` s under the signals that the laws were given last."""
        if self._rates:
            _advance_own(*self.table[:2], *self._own, h)


@kept(error_model='numpy')
def evaluate_columns(buffer, base, calls, reads, signals, out):  # type: ignore[no-untyped-def]
    """Write every column to `out` (C,) for a vector of signals; see `LawColumns.table`."""
    if calls.shape[0] == 0:
        return
    for r in range(reads.shape[0]):
        row = reads[r, 0] * LANES
        for k in range(LANES):
            buffer[row + k] = signals[reads[r, 1]]
    p, at = as_pointer(base), 0
    for i in range(calls.shape[0]):
        row, wide = calls[i, _TARGET], calls[i, _WIDTH]
        for k in range(0, wide, WIDTH):
            put(p, row + k, spread(0.0))
            call_all(base + 8 * k, calls, i, i + 1)
        for k in range(wide):
            out[at + k] = buffer[row + k]
        at += wide


@kept(error_model='numpy')
def _advance_own(buffer, base, calls, fades, values, rates, h):  # type: ignore[no-untyped-def]
    """Take the simulator's step of the own states; one that left all bounds begins anew."""
    count, p, step = values.size, as_pointer(base), spread(h)
    old, old_rate, ahead = rows(count), rows(count), rows(count)
    evaluate_rates(p, base, calls, rates)
    predict_own(p, base, calls, fades, values, rates, step, old, old_rate, ahead)
    evaluate_rates(p, base, calls, rates)
    correct_own(p, base, calls, fades, values, rates, step, old, old_rate)
    for s in range(count):
        value = buffer[values[s]] if abs(buffer[values[s]]) < _ABSURD else 0.0
        for k in range(LANES):
            buffer[values[s] + k] = value
