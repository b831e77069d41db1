"""Read a CSV file, plain or gzipped, into columns of numbers, and say which cell is wrong."""

from collections.abc import Iterable, Sequence
import csv
from dataclasses import dataclass, field
import io
from pathlib import Path
import re
import warnings
import zlib

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.signals.finding import Finding, Severity

Array = NDArray[np.float64]

MISSING = {'', 'na', 'n/a', 'null', 'none', '-', 'nan'}
WORDS = {'true': 1.0, 'false': 0.0}
TOLERATED = 0.01
"""Share of bad cells in a column up to which their rows are dropped instead of refused."""


@dataclass
class Table:
    """A text table: its header, and its body still as text.

    Attributes
    ----------
    path:
        The file.
    names:
        Headers of the columns, stripped.
    body:
        All lines below the header.
    delimiter:
        ``,``, ``;``, tab or ``|``.
    first_line:
        Line number of the first line of `body` in the file, from 1.
    findings:
        What was wrong, filled while reading.
    """

    path: Path
    names: tuple[str, ...]
    body: str
    delimiter: str
    first_line: int
    findings: list[Finding] = field(default_factory=list)

    def numbers(self, columns: Sequence[str]) -> dict[str, Array]:
        """Return columns (N,) as numbers; a missing or bad cell is NaN.

        Raises
        ------
        UserError
            If more than 1 % of the cells of a column are no numbers.
        """
        positions = [self.position(name) for name in columns]
        try:
            values = self._parse(self.body, positions)
        except ValueError:
            try:
                values = self._parse(self._filled(), positions)
            except ValueError:
                return self._cell_by_cell(columns, positions)
        return {name: values[:, i].copy() for i, name in enumerate(columns)}

    def texts(self, column: str) -> list[str]:
        """Return one column as stripped texts."""
        position = self.position(column)
        return [row[position].strip() if position < len(row) else '' for row in self._rows()]

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

    def _parse(self, body: str, positions: Sequence[int]) -> Array:
        quoted = '"' if '"' in body else None
        comments = '#' if '#' in body else None
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', UserWarning)  # nothing but comments: said later
            return np.loadtxt(
                io.StringIO(body), delimiter=self.delimiter, usecols=positions, ndmin=2,
                comments=comments, quotechar=quoted,
            )  # fmt: skip

    def _filled(self) -> str:
        """Return the body with ``nan`` in empty cells."""
        mark = re.escape(self.delimiter)
        blank = r'[^\S\n\t]*'
        body = re.sub(rf'(?m)(?<={mark}){blank}(?={mark}|$)', 'nan', self.body)
        return re.sub(rf'(?m)^{blank}(?={mark})', 'nan', body)

    def _rows(self) -> Iterable[list[str]]:
        reader = csv.reader(io.StringIO(self.body), delimiter=self.delimiter)
        return (row for row in reader if row and not row[0].startswith('#'))

    def _cell_by_cell(
        self, columns: Sequence[str], positions: Sequence[int]
    ) -> dict[str, Array]:
        """Read every cell on its own, and report those that are no numbers."""
        reader = csv.reader(io.StringIO(self.body), delimiter=self.delimiter)
        lines: list[int] = []
        rows: list[list[str]] = []
        for row in reader:
            if row and not row[0].startswith('#'):
                lines.append(self.first_line + reader.line_num - 1)
                rows.append(row)
        if rows and len(rows[-1]) < len(self.names):
            rows.pop()  # the last line of a logger that was stopped while writing
        found: dict[str, Array] = {}
        for name, position in zip(columns, positions, strict=True):
            cells = [row[position] if position < len(row) else '' for row in rows]
            numbers = [_number(cell) for cell in cells]
            found[name] = np.array([np.nan if x is None else x for x in numbers])
            bad = [i for i, number in enumerate(numbers) if number is None]
            if bad:
                self._report(name, len(bad), len(rows), lines[bad[0]], cells[bad[0]])
        return found

    def _report(self, name: str, bad: int, total: int, line: int, cell: str) -> None:
        """Note bad cells, or refuse the file if there are many."""
        where = f'line {line}, column `{name}`: `{cell.strip()[:40]}` is not a number'
        if bad > TOLERATED * total:
            raise UserError(
                f'{self.path}: {where}; {bad} of {total} rows are like that; mend the file, or '
                'leave the column out through a msg_config file'
            )
        self.findings.append(
            Finding(
                Severity.WARNING, 'text_in_number_column', f'{where} ({bad} of {total} rows)',
                'these rows are left out', 'mend or delete them if they matter',
                {'rows': bad, 'line': line},
            )
        )  # fmt: skip


def read_table(path: Path) -> Table:
    """Open a CSV or CSV.GZ file.

    Raises
    ------
    UserError
        If it is empty, not text, or has no header or no rows.
    """
    findings: list[Finding] = []
    text = _text(path, findings)
    lines = text.split('\n', 100)
    start = next((i for i, x in enumerate(lines) if x.strip() and not x.startswith('#')), None)
    if start is None:
        raise UserError(f'{path} is empty; it needs a header line such as `time [s],voltage [V]`')
    header = lines[start]
    delimiter = max(',;\t|', key=header.count)
    names = tuple(name.strip() for name in next(csv.reader([header], delimiter=delimiter)))
    if all(_number(name) is not None for name in names):
        raise UserError(
            f'{path} has no header line: it begins with `{header.strip()[:60]}`; '
            'put one above, such as `time [s],voltage [V],speed [rad/s]`'
        )
    body = text.split('\n', start + 1)[start + 1] if len(lines) > start + 1 else ''
    if not body.strip():
        raise UserError(f'{path} has a header ({", ".join(names)}) but no rows')
    if delimiter == ';' and ',' in body:
        body = body.replace(',', '.')  # a decimal comma
    return Table(path, names, body, delimiter, start + 2, findings)


def _text(path: Path, findings: list[Finding]) -> str:
    """Return the text of a file, decompressed as far as that is possible."""
    data = path.read_bytes()
    if data[:2] == b'\x1f\x8b':
        data = _gunzip(path, data, findings)
    if b'\0' in data[:4096] and data[:2] not in {b'\xff\xfe', b'\xfe\xff'}:
        raise UserError(
            f'{path} is not a text file; DATA is a bag, .mcap, .db3, CSV, CSV.GZ, .mat or .npz'
        )
    encoding = 'utf-16' if data[:2] in {b'\xff\xfe', b'\xfe\xff'} else 'utf-8-sig'
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        text = data.decode('latin-1')
    return text.replace('\r\n', '\n').replace('\r', '\n')


def _gunzip(path: Path, data: bytes, findings: list[Finding]) -> bytes:
    parts: list[bytes] = []
    try:
        while data:  # one file may be several gzip streams in a row
            stream = zlib.decompressobj(wbits=31)
            parts.append(stream.decompress(data))
            if not stream.eof:
                raise zlib.error('it breaks off')
            data = stream.unused_data.lstrip(b'\0')
    except zlib.error as error:
        text = b''.join(parts)
        if not text:
            raise UserError(f'{path} is a damaged gzip file ({error})') from None
        findings.append(
            Finding(
                Severity.WARNING, 'damaged_file', f'{path.name} is a damaged gzip file: {error}',
                'the rows up to the damage were read', 'copy the file again from its source',
            )
        )  # fmt: skip
        return text[: text.rfind(b'\n') + 1]
    return b''.join(parts)


def _number(cell: str) -> float | None:
    """Return the number in a cell, NaN if it is empty, None if it is something else."""
    word = cell.strip().lower()
    if word in MISSING:
        return float('nan')
    try:
        return WORDS[word] if word in WORDS else float(word)
    except ValueError:
        return None
