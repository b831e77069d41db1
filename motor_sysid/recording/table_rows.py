"""From the columns of a table to rows of signals, as a msg_config says."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.recording.arrays import ArrayTable
from motor_sysid.recording.rows import Rows
from motor_sysid.recording.sources import ISO, MsgConfig, Source, TimeColumn
from motor_sysid.recording.table import Table
from motor_sysid.signals.units import parse_unit

Array = NDArray[np.float64]
Columns = Table | ArrayTable


def rows_of_table(table: Columns, config: MsgConfig) -> tuple[list[Rows], dict[str, Source]]:
    """Read the signals that a msg_config names.

    Returns
    -------
    tuple
        Rows (one for each run of the column `segment_by`), and the source of each signal.

    Raises
    ------
    UserError
        If a column is missing, or holds text where numbers should be.
    """
    if config.time is None:
        raise UserError(
            f'{config.origin} names no time column; add `time: {{column: COLUMN, unit: s}}`, or '
            f'`time: {{step: SECONDS}}` if there is none; the '
            f'columns of {table.path} are {", ".join(table.names)}'
        )
    chosen = _choose(table, config)
    columns = [source.column for source in chosen.values()]
    timed = [config.time.column] if config.time.column and config.time.unit != ISO else []
    numbers = table.numbers(list(dict.fromkeys([*timed, *columns])))
    time = _time(table, config.time, numbers)
    units = {name: source.si_unit() for name, source in chosen.items()}
    signals = {
        name: source.continuous(numbers[source.column], table.findings)
        for name, source in chosen.items()
    }
    pieces = _segments(Rows(time, signals, units), table, config)
    return [_shifted(rows, chosen) for rows in pieces], chosen


def _shifted(rows: Rows, chosen: dict[str, Source]) -> Rows:
    """Move values to the rows that they belong to; what has none any more is NaN."""
    signals = dict(rows.signals)
    for name, source in chosen.items():
        if source.shift:
            moved = np.roll(signals[name], source.shift)
            lost = slice(source.shift) if source.shift > 0 else slice(source.shift, None)
            moved[lost] = np.nan
            signals[name] = moved
    return replace(rows, signals=signals)


def _time(table: Columns, time: TimeColumn, numbers: dict[str, Array]) -> Array:
    """Return the times (N,) of the rows, s."""
    if time.unit == ISO:
        return table.dates(time.column)
    unit = parse_unit(time.unit)
    if time.column:
        return unit.to_si(time.step * numbers[time.column])
    rows = next(iter(numbers.values())).size
    return unit.to_si(time.step * np.arange(rows, dtype=np.float64))


def _choose(table: Columns, config: MsgConfig) -> dict[str, Source]:
    """Take the first source of each signal that the table has."""
    chosen: dict[str, Source] = {}
    for name, sources in config.sources.items():
        columns = [source for source in sources if source.column]
        for source in columns:
            if name not in chosen and source.column in table.names:
                chosen[name] = source
        required = [source for source in columns if not source.optional]
        if name not in chosen and required:
            table.position(required[0].column)  # raises, and names the columns
    if not chosen:
        raise UserError(
            f'{config.origin} names no column of {table.path}; its columns are '
            f'{", ".join(table.names)}; write e.g. `voltage: {{column: COLUMN, unit: V}}`'
        )
    return chosen


def _segments(rows: Rows, table: Columns, config: MsgConfig) -> list[Rows]:
    """Cut where the column named by `segment_by` changes."""
    if not config.segment_by:
        return [rows]
    labels = np.array(table.texts(config.segment_by))
    if labels.size != rows.time.size:
        raise UserError(
            f'{table.path}: `segment_by` column `{config.segment_by}` has {labels.size} values, '
            f'the others {rows.time.size}; they belong to different records'
        )
    edges = [0, *(np.flatnonzero(labels[1:] != labels[:-1]) + 1).tolist(), labels.size]
    return [
        replace(rows.take(slice(start, stop)), label=str(labels[start]))
        for start, stop in pairwise(edges)
    ]
