"""Read a CSV file, plain or gzipped, into columns of numbers, and say which cell is wrong."""

from collections.abc import Callable, Sequence
import csv
from dataclasses import dataclass, field, replace
from pathlib import Path
import re
from typing import TypeVar
import warnings

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.recording.sources import ISO, quoted
from motor_sysid.recording.table_lines import (
    are_numbers,
    cells_of,
    Lines,
    MISSING,
    number_in,
    read_lines,
    TOLERATED,
)
from motor_sysid.signals.finding import Finding, Severity

Array = NDArray[np.float64]
Value = TypeVar('Value')

NO_DATE = np.datetime64('NaT', 'ns')


@dataclass
class Table:
    """A text table: its header, and its rows still as text.

    Attributes
    ----------
    path:
        The file.
    lines:
        What it consists of.
    findings:
        What was wrong, filled while reading.
    """

    path: Path
    lines: Lines
    findings: list[Finding] = field(default_factory=list)

    @property
    def names(self) -> tuple[str, ...]:
        """Headers of the columns."""
        return self.lines.names

    @property
    def dated(self) -> frozenset[str]:
        """Headers of the columns that begin with a date."""
        cells = cells_of(self.lines.rows[0], self.lines.delimiter) or []
        return frozenset(
            name for name, cell in zip(self.names, cells, strict=False) if _is_date(cell.strip())
        )

    def numbers(self, columns: Sequence[str]) -> dict[str, Array]:
        """Return columns (N,) as numbers; a missing or bad cell is NaN.

        Raises
        ------
        UserError
            If more than 1 % of the cells of a column are no numbers.
        """
        positions = [self.position(name) for name in columns]
        try:
            values = self._parse(self.lines.rows, positions)
        except ValueError:
            try:
                values = self._parse(self._filled(), positions)
            except ValueError:
                return {name: self._cell_by_cell(name) for name in columns}
        return {name: values[:, i].copy() for i, name in enumerate(columns)}

    def dates(self, column: str) -> Array:
        """Return a column of dates such as ``2025-11-12T10:03:29.555Z``.

        Returns
        -------
        Array
            (N,) s since the first of them; a missing or bad cell is NaN.

        Raises
        ------
        UserError
            If more than 1 % of the cells are no dates.
        """
        texts = self.texts(column)
        try:
            stamps = _stamps(texts)
        except ValueError:
            found = self._each(column, texts, _stamp, 'date')
            stamps = np.array([NO_DATE if x is None else x for x in found])
        known = ~np.isnat(stamps)
        if not np.any(known):
            raise UserError(f'{self.path}: column `{column}` holds no date')
        since = (stamps - stamps[known][0]).astype(np.int64) / 1e9
        return np.where(known, since, np.nan)

    def texts(self, column: str) -> list[str]:
        """Return one column (N,) as stripped texts."""
        position = self.position(column)
        reader = csv.reader(self.lines.rows, delimiter=self.lines.delimiter)
        return [row[position].strip() if position < len(row) else '' for row in reader]

    def position(self, name: str) -> int:
        """Return the position of a column.

        Raises
        ------
        UserError
            If there is no such column, or more than one.
        """
        count = self.names.count(name)
        if count != 1:
            what = 'no column' if count == 0 else f'{count} columns'
            raise UserError(
                f'{self.path} has {what} `{name}`; its columns are {", ".join(self.names)}'
            )
        return self.names.index(name)

    def _parse(self, rows: Sequence[str], positions: Sequence[int]) -> Array:
        quoted, comments = (mark if mark in self.lines.marks else None for mark in '"#')
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', UserWarning)  # nothing but comments: said later
            values = np.loadtxt(
                rows, delimiter=self.lines.delimiter, usecols=positions, ndmin=2,
                comments=comments, quotechar=quoted,
            )  # fmt: skip
        if len(values) != len(rows):
            raise ValueError('a comment was taken for a row')
        return values

    def _filled(self) -> list[str]:
        """Return the rows with ``nan`` in empty cells."""
        mark = re.escape(self.lines.delimiter)
        blank = r'[^\S\n\t]*'
        body = '\n'.join(self.lines.rows)
        body = re.sub(rf'(?m)(?<={mark}){blank}(?={mark}|$)', 'nan', body)
        return re.sub(rf'(?m)^{blank}(?={mark})', 'nan', body).split('\n')

    def _cell_by_cell(self, column: str) -> Array:
        """Read every cell on its own, and report those that are no numbers."""
        numbers = self._each(column, self.texts(column), number_in, 'number')
        return np.array([np.nan if x is None else x for x in numbers])

    def _each(
        self, column: str, cells: Sequence[str], read: Callable[[str], Value | None], kind: str
    ) -> list[Value | None]:
        """Read every cell; note those that are not of the kind, or refuse the file if many are."""
        values = [read(cell) for cell in cells]
        bad = [k for k, value in enumerate(values) if value is None]
        if not bad:
            return values
        line, share = self.lines.numbers[bad[0]], f'{len(bad)} of {len(cells)} rows'
        where = f'line {line}, column `{column}`: `{cells[bad[0]][:40]}` is not a {kind}'
        if len(bad) > TOLERATED * len(cells):
            remedy = 'mend the file, or leave the column out through a msg_config file'
            if _is_date(cells[bad[0]]):
                date = f'time: {{column: {quoted(column)}, unit: {ISO}}}'
                remedy = f'if it is the time, write `{date}` in a msg_config file'
            raise UserError(f'{self.path}: {where}; {share} are like that; {remedy}')
        self.findings.append(
            Finding(
                Severity.WARNING, 'text_in_number_column', f'{where} ({share})',
                'these rows are left out', 'mend or delete them if they matter',
                {'rows': len(bad), 'line': line},
            )
        )  # fmt: skip
        return values


def read_table(path: Path) -> Table:
    """Open a CSV or CSV.GZ file.

    Raises
    ------
    UserError
        If it is empty, not text, or has no header or no rows.
    """
    findings: list[Finding] = []
    lines = read_lines(path, findings)
    if len(lines.names) > 1 and not lines.names[0]:  # as pandas writes an index without a name
        first = (cells_of(lines.rows[0], lines.delimiter) or [''])[0].strip()
        lines = replace(lines, names=('time' if _is_date(first) else 'index', *lines.names[1:]))
    if are_numbers(lines.names):
        raise UserError(
            f'{path} has no header line: it begins with `{", ".join(lines.names)[:60]}`; '
            'put one above, such as `time [s],voltage [V]`'
        )
    return Table(path, lines, findings)


def _stamps(cells: Sequence[str]) -> NDArray[np.datetime64]:
    """Return dates, in UTC where they name their zone; raises ValueError if one is none."""
    texts = ['' if cell.lower() in MISSING else cell.rstrip('Zz') for cell in cells]
    if any(text and text[4:5] != '-' for text in texts):
        raise ValueError('no date')  # numpy knows `today`, and takes a number for a year
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # numpy has no zones: it converts, and complains
        return np.array(texts, dtype='datetime64[ns]')


def _stamp(cell: str) -> np.datetime64 | None:
    """Return the date in a cell, not a time if it is empty, None if it is something else."""
    try:
        return np.datetime64(_stamps([cell])[0])
    except ValueError:
        return None


def _is_date(cell: str) -> bool:
    """Tell whether a cell holds a date such as ``2025-11-12T10:03:29``."""
    stamp = _stamp(cell)
    return stamp is not None and not bool(np.isnat(stamp))
