"""Fit a structure to records, and run it: orders and sample time are chosen by held-out runs."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.signals.record import Record
from motor_sysid.structures.base import (
    Kind,
    Numbers,
    Run,
    runs_of,
    scaled,
    sizes,
    START_ROWS,
    Structure,
)
from motor_sysid.structures.kinds import KINDS, known_kind

Array = NDArray[np.float64]

FEWEST = 300
"""Rows that training must keep at the sample time of a structure."""

_WORTH = 0.99
_HIGHEST_ORDER = 30


def fit(
    records: Record | Sequence[Record],
    inputs: Sequence[str],
    outputs: Sequence[str],
    kind: str = 'tf',
    *,
    order: int | None = None,
    stride: int | None = None,
    hold_back: float = 0.25,
) -> Structure:
    """Fit one kind of structure.

    Parameters
    ----------
    records:
        Data; cut where samples are missing.
    inputs, outputs:
        Signals.
    kind:
        Key of `KINDS`.
    order:
        Order of every part; None chooses it by the free run over the held-back end of the records,
        and fits again to all of them.
    stride:
        Sample time of the structure in samples of the records; None chooses it, too.
    hold_back:
        Part of each stretch that the choice looks at.

    Raises
    ------
    UserError
        If the kind is unknown, a signal is missing, a number is out of range or nothing is left.
    """
    given = [records] if isinstance(records, Record) else list(records)
    _check(given, inputs, outputs, kind, order, stride, hold_back)
    one, dt = KINDS[kind], given[0].dt
    best: tuple[float, int, tuple[int, ...]] | None = None
    tried = one.strides if stride is None else (stride,)
    whole = runs_of(given, inputs, outputs, dt)
    known = order is not None and len(tried) == 1
    for step in tried:
        if step > min(tried) and sum(map(len, whole)) < FEWEST * step:
            continue
        if known and order is not None:
            best = (0.0, step, (order,) * (1 if one.joint else len(outputs)))
            break
        runs = runs_of(given, inputs, outputs, step * dt)
        error, orders = _chosen(one, runs, order, step * dt, hold_back)
        if best is None or error < best[0]:
            best = (error, step, orders)
    assert best is not None
    return _fitted(one, given, inputs, outputs, best[1] * dt, best[2])


def _check(
    records: Sequence[Record], inputs: Sequence[str], outputs: Sequence[str], kind: str,
    order: int | None, stride: int | None, hold_back: float,
) -> None:  # fmt: skip
    known_kind(kind)
    if not records or not inputs or not outputs:
        raise UserError('give at least one record, one input and one output')
    for record in records:
        for name in (*inputs, *outputs):
            record[name]
    if order is not None and not 1 <= order <= _HIGHEST_ORDER:
        raise UserError(f'order {order}; give 1 to {_HIGHEST_ORDER}, or none to choose it')
    if stride is not None and stride < 1:
        raise UserError(f'stride {stride}; give 1 or more samples, or none to choose it')
    if not 0 < hold_back < 1:
        raise UserError(f'hold_back {hold_back:g} is not between 0 and 1')


def _chosen(
    kind: Kind, runs: Sequence[Run], order: int | None, dt: float, hold_back: float
) -> tuple[float, tuple[int, ...]]:
    """Return the held-out error, relative, and the best order of every part."""
    size = sizes(runs)
    even = scaled(runs, *size)
    found = []
    for part in _parts(kind, even):
        cuts = [max(round((1 - hold_back) * len(run)), START_ROWS) for run in part]
        errors: list[tuple[float, int]] = []
        for n in kind.orders if order is None else (order,):
            errors.append((_held_error(kind, part, cuts, n, dt), n))
            if len(errors) > 2 and errors[-1][0] > _WORTH * min(e for e, _ in errors[:-1]):
                break
        found.append(simplest(errors))
    return float(np.sqrt(np.mean([error**2 for error, _ in found]))), tuple(n for _, n in found)


def simplest(errors: Sequence[tuple[float, int]]) -> tuple[float, int]:
    """Return the smallest order that no larger one beats by a percent."""
    lowest = min(error for error, _ in errors)
    return next((e, n) for e, n in errors if _WORTH * e <= lowest)


def _held_error(
    kind: Kind, runs: Sequence[Run], cuts: Sequence[int], order: int, dt: float
) -> float:
    """Return the RMS error of free runs over what was held back, infinite where they run away."""
    before = [run.until(cut) for run, cut in zip(runs, cuts, strict=True)]
    try:
        with np.errstate(all='ignore'):
            numbers = kind.fit(before, order, dt)
            left = [
                (run.y - kind.simulate(numbers, run.u, run.y[:START_ROWS], dt))[cut:]
                for run, cut in zip(runs, cuts, strict=True)
            ]
    except (np.linalg.LinAlgError, ValueError):  # too little data for so many numbers
        return np.inf
    error = float(np.sqrt(np.mean(np.concatenate(left) ** 2)))
    return error if np.isfinite(error) else np.inf


def _parts(kind: Kind, runs: Sequence[Run]) -> list[list[Run]]:
    """Return the runs that each part of a structure is fitted to."""
    if kind.joint:
        return [list(runs)]
    return [[run.output(j) for run in runs] for j in range(runs[0].y.shape[1])]


def _fitted(
    kind: Kind, records: Sequence[Record], inputs: Sequence[str], outputs: Sequence[str],
    dt: float, orders: tuple[int, ...],
) -> Structure:  # fmt: skip
    runs = runs_of(records, inputs, outputs, dt)
    size = sizes(runs)
    parts: list[Numbers] = []
    for part, order in zip(_parts(kind, scaled(runs, *size)), orders, strict=True):
        try:
            with np.errstate(all='ignore'):
                parts.append(kind.fit(part, order, dt))
        except (np.linalg.LinAlgError, ValueError):
            raise UserError(
                f'{kind.title} of order {order} cannot be fitted to these data; '
                'try a smaller order or a longer record'
            ) from None
    return Structure(kind.key, tuple(inputs), tuple(outputs), dt, orders, *size, tuple(parts))


def simulate(structure: Structure, record: Record, *, at_rest: bool = False) -> Array:
    """Return the (N, p) outputs of a free run at the times of a record, in SI units.

    It begins as the first measured rows ask for, or at rest; a structure with longer samples than
    the record is interpolated by straight lines.
    """
    def run(kind: Kind, numbers: Numbers, one: Run) -> Array:
        start = one.y[:0] if at_rest else one.y[:START_ROWS]
        return kind.simulate(numbers, one.u, start, structure.dt)

    return _rows(structure, record, run, measured=not at_rest)


def predict(structure: Structure, record: Record) -> Array:
    """Return the (N, p) outputs as foretold one of the structure's samples ahead, in SI units."""
    return _rows(
        structure, record, lambda kind, numbers, one: kind.predict(numbers, one, structure.dt),
        measured=True,
    )  # fmt: skip


def _rows(
    structure: Structure,
    record: Record,
    run: Callable[[Kind, Numbers, Run], Array],
    *,
    measured: bool,
) -> Array:
    s, kind = structure, KINDS[structure.kind]
    even = record.select([*s.inputs, *(s.outputs if measured else ())]).uniform(s.dt)
    u = np.column_stack([even[name] for name in s.inputs]) / s.input_size
    y = np.zeros((len(even), len(s.outputs)))
    if measured:
        y = np.column_stack([even[name] for name in s.outputs]) / s.output_size
    whole = Run(u, y)
    views = [whole] if kind.joint else [whole.output(j) for j in range(y.shape[1])]
    columns = np.column_stack(
        [run(kind, dict(part), view) for part, view in zip(s.parts, views, strict=True)]
    )
    columns = columns * s.output_size
    if len(even) == len(record):
        return np.asarray(columns)
    return np.column_stack([np.interp(record.time, even.time, column) for column in columns.T])

