"""The lines of a CSV file, plain or gzipped: which of them are rows, and which are damaged."""

from collections.abc import Sequence
import csv
from dataclasses import dataclass, replace
from pathlib import Path
import re
import zlib

from motor_sysid.errors import UserError
from motor_sysid.recording.number_style import with_decimal_points
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.units import is_unit

TOLERATED = 0.01
"""Share of bad rows up to which they are left out instead of refused."""
LONGEST = csv.field_size_limit()
MISSING = {'', 'na', 'n/a', 'null', 'none', '-', 'nan'}
WORDS = {'true': 1.0, 'false': 0.0}
DELIMITERS = ',;\t|'
SEPARATOR = re.compile('"?sep=.?"?')
"""A first line by which spreadsheets are told the delimiter."""
BYTE_ORDER = {b'\xff\xfe', b'\xfe\xff'}
OPEN = 'has a quote that is not closed', 'mend the quotes, which may not reach over several lines'
SURPLUS = (
    'numbers of rows without a header of their own do that, and decimal commas between commas: '
    'give every column a header, and write decimal points'
)


@dataclass(frozen=True)
class Lines:
    """The header of a CSV file, and its rows as text.

    Attributes
    ----------
    names:
        Headers of the columns, stripped.
    delimiter:
        ``,``, ``;``, tab or ``|``.
    rows:
        Lines with a value in them, neither comments nor blank, no quote left open and no more
        values than `names`.
    numbers:
        Line number of each of them in the file, from 1.
    marks:
        Which of ``"`` and ``#`` the file has anywhere.
    """

    names: tuple[str, ...]
    delimiter: str
    rows: Sequence[str]
    numbers: Sequence[int]
    marks: str = ''


def read_lines(path: Path, findings: list[Finding]) -> Lines:
    """Read a CSV or CSV.GZ file; what is damaged in it is added to `findings`.

    A header may stand in the last comment before the numbers, as `numpy.savetxt` writes it.

    Raises
    ------
    UserError
        If it is empty, not text, or has no header or no rows, or many of them are damaged.
    """
    text = _text(path, findings)
    lines = text.split('\n')
    filled = [k for k, line in enumerate(lines) if (begin := line.lstrip()) and begin[0] != '#']
    if not filled:
        raise UserError(f'{path} is empty; it needs a header line such as `time [s],voltage [V]`')
    if SEPARATOR.fullmatch(lines[filled[0]].strip()) and len(filled) > 1:
        del filled[0]
    if not any(mark in lines[filled[0]] for mark in DELIMITERS):
        lines = _tabbed(lines, filled)
    top = lines[filled[0]]
    delimiter = max(DELIMITERS, key=re.sub('"[^"]*"', '', top).count)
    names, kept = _names(top, delimiter), filled[1:]
    above = next((line for line in reversed(lines[: filled[0]]) if line.strip()), '')
    title = _names(above.lstrip().lstrip('#'), delimiter)
    if len(title) == len(names) and are_numbers(names) and not are_numbers(title):
        names, kept = title, filled
    if kept and (units := _units(_names(lines[kept[0]], delimiter))):
        names, kept = _with_units(names, units), kept[1:]
    if not kept:
        raise UserError(f'{path} has a header ({", ".join(names)}) but no rows')
    rows = [lines[k] for k in kept]
    if delimiter != ',':
        rows = with_decimal_points(rows, delimiter)
    marks = ''.join(mark for mark in '"#' if mark in text)
    found = Lines(names, delimiter, rows, [k + 1 for k in kept], marks)
    return _without_broken(path, _without_unfinished(found, findings), findings)


def _tabbed(lines: list[str], filled: Sequence[int]) -> list[str]:
    """Return the lines of a table with blanks between its columns, with tabs there.

    Without two numbers or more in its second row it is none.  A blank before a bracket is part of
    a header: ``speed [rad/s]``.
    """
    cells = lines[filled[min(1, len(filled) - 1)]].split()
    if len(cells) < 2 or not are_numbers(cells):
        return lines
    return [re.sub(r'(?<=[^\s#])[ \t]+(?![\[(\s])', '\t', line.strip()) for line in lines]


def _names(line: str, delimiter: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in cells_of(line, delimiter) or [line])


def _units(cells: Sequence[str]) -> tuple[str, ...]:
    """Return the units in a line below the header, as oscilloscopes write it; none if it is not.

    In such a line there is no number, and a unit at least; ``(ms)`` is ``ms``.
    """
    units = tuple(re.sub(r'^[(\[](.*)[)\]]$', r'\1', cell.strip('" ')) for cell in cells)
    if any(number_in(cell.replace(',', '.')) is not None for cell in cells if cell.strip('" ')):
        return ()
    return units if any(is_unit(unit) for unit in units if unit) else ()


def _with_units(names: tuple[str, ...], units: tuple[str, ...]) -> tuple[str, ...]:
    """Return headers with their units in brackets, where they bear none."""
    rest = ('',) * (len(names) - len(units))
    return tuple(
        f'{name} [{unit}]' if unit and not name.endswith((']', ')')) else name
        for name, unit in zip(names, units + rest, strict=False)
    )


def are_numbers(cells: Sequence[str]) -> bool:
    """Tell whether a line holds numbers only, with points or commas: it is no header."""
    return all(number_in(cell.replace(',', '.')) is not None for cell in cells)


def number_in(cell: str) -> float | None:
    """Return the number in a cell, NaN if it is empty, None if it is something else."""
    word = cell.strip().lower()
    if word in MISSING:
        return float('nan')
    try:
        return WORDS[word] if word in WORDS else float(word)
    except ValueError:
        return None


def cells_of(line: str, delimiter: str) -> list[str] | None:
    """Return the cells of a line, or None where a quote is not closed on it."""
    reader = csv.reader([line, ''], delimiter=delimiter)
    try:
        cells = next(reader)
    except csv.Error:  # a cell longer than LONGEST
        return None
    return cells if reader.line_num == 1 else None


def _without_unfinished(lines: Lines, findings: list[Finding]) -> Lines:
    """Leave out the last line of a logger that was stopped while writing."""
    if len(lines.rows) == 1:
        return lines
    before, last = (cells_of(row, lines.delimiter) for row in lines.rows[-2:])
    usual = min(len(before or lines.names), len(lines.names))
    if last is not None and len(last) >= usual:
        return lines
    has = 'a quote that is not closed' if last is None else f'{len(last)} of {usual} values'
    findings.append(
        Finding(
            Severity.INFO, 'broken_lines',
            f'the last line ({lines.numbers[-1]}) breaks off with {has}; left out',
            '', '', {'rows': 1, 'line': lines.numbers[-1]},
        )
    )  # fmt: skip
    return replace(lines, rows=lines.rows[:-1], numbers=lines.numbers[:-1])


def _without_broken(path: Path, lines: Lines, findings: list[Finding]) -> Lines:
    """Leave out lines that cannot be read as a row; refuse the file if there are many."""
    most, delimiter, quoted = len(lines.names) - 1, lines.delimiter, '"' in lines.marks
    suspects = (
        k for k, row in enumerate(lines.rows)
        if row.count(delimiter) > most or len(row) > LONGEST or (quoted and '"' in row)
    )  # fmt: skip
    broken = {k: fault for k in suspects if (fault := _fault(lines.rows[k], lines))}
    if not broken:
        return lines
    first, total = next(iter(broken)), len(lines.rows)
    what, remedy = broken[first]
    where = f'line {lines.numbers[first]} {what} ({len(broken)} of {total} lines)'
    if len(broken) > TOLERATED * total:
        raise UserError(f'{path}: {where}; {remedy}')
    findings.append(
        Finding(
            Severity.WARNING, 'broken_lines', where, 'these lines are left out',
            'mend or delete them if they matter',
            {'rows': len(broken), 'line': lines.numbers[first]},
        )
    )  # fmt: skip
    kept = [k for k in range(total) if k not in broken]
    rows, numbers = [lines.rows[k] for k in kept], [lines.numbers[k] for k in kept]
    return replace(lines, rows=rows, numbers=numbers)


def _fault(row: str, lines: Lines) -> tuple[str, str] | None:
    """Say what is wrong with a row, and what to do; a comment may stand behind its values."""
    cells = cells_of(row if '"' in row else row.partition('#')[0], lines.delimiter)
    if cells is None:
        return OPEN if '"' in row else (f'has {len(row)} letters', 'delete it')
    width = len(lines.names)
    if any(cell.strip() for cell in cells[width:]):
        return f'has {len(cells)} values for {width} columns ({", ".join(lines.names)})', SURPLUS
    return None


def _text(path: Path, findings: list[Finding]) -> str:
    """Return the text of a file, decompressed as far as that is possible."""
    data = path.read_bytes()
    if data[:2] == b'\x1f\x8b':
        data = _gunzip(path, data, findings)
    encoding = 'utf-16' if data[:2] in BYTE_ORDER else 'utf-8-sig'
    if encoding == 'utf-8-sig' and b'\0' in data.rstrip(b'\0')[:4096]:
        raise UserError(
            f'{path} is not a text file; DATA is a bag, .mcap, .db3, CSV, CSV.GZ, .mat or .npz'
        )
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        text = data.decode('latin-1')
    whole = text.rstrip('\0')
    if len(whole) < len(text):
        message = f'{path.name} ends with {len(text) - len(whole)} zeros in place of text'
        findings.append(_damage(message))
    return whole.replace('\r\n', '\n').replace('\r', '\n')


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
        findings.append(_damage(f'{path.name} is a damaged gzip file: {error}'))
        return text[: text.rfind(b'\n') + 1]
    return b''.join(parts)


def _damage(message: str) -> Finding:
    return Finding(
        Severity.WARNING, 'damaged_file', message, 'the rows up to the damage were read',
        'copy the file again from its source',
    )  # fmt: skip
