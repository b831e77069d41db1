"""How a table writes numbers: with decimal commas, or with a mark between the thousands."""

from collections.abc import Sequence
import re

POINTED = r'[-+]?\d*\.\d+(?:[eE][-+]?\d+)?'
THOUSANDS = r'[-+]?[1-9]\d{0,2}(?:,\d{3})+(?:\.\d*)?'
"""``1,436``: a comma before every three digits, and no zero in front."""
POINTED_THOUSANDS = r'[-+]?[1-9]\d{0,2}(?:\.\d{3})+(?:,\d*)?'
"""``1.436,5``, and in the same table ``1.436``."""


def with_decimal_points(rows: Sequence[str], delimiter: str) -> list[str]:
    """Return the rows of a table whose delimiter is no comma, with numbers as Python reads them.

    A comma is a decimal comma, but where each stands before three digits, and other numbers have
    points, or others of its column no comma: there it marks thousands.
    """
    body = '\n'.join(rows)
    if ',' not in body:
        return list(rows)
    if _marks_thousands(rows, body, delimiter):
        marked = _cell(THOUSANDS, delimiter)
        return marked.sub(lambda cell: cell[0].replace(',', ''), body).split('\n')
    if any(',' in cell for cell in _cell(POINTED_THOUSANDS, delimiter).findall(body)):
        marked = _cell(POINTED_THOUSANDS, delimiter)
        body = marked.sub(lambda cell: cell[0].replace('.', ''), body)
    return body.replace(',', '.').split('\n')


def _marks_thousands(rows: Sequence[str], body: str, delimiter: str) -> bool:
    marked = _cell(THOUSANDS, delimiter).findall(body)
    if body.count(',') != sum(cell.count(',') for cell in marked):
        return False
    if _cell(POINTED, delimiter).search(body):
        return True
    cells = [row.split(delimiter) for row in rows]
    columns = {k for row in cells for k, cell in enumerate(row) if ',' in cell}
    return all(
        any(k < len(row) and row[k].strip(' "').lstrip('+-').isdigit() for row in cells)
        for k in columns
    )


def _cell(pattern: str, delimiter: str) -> re.Pattern[str]:
    """Return a pattern for a cell that holds nothing else."""
    mark = re.escape(delimiter)
    return re.compile(rf'(?m)(?:(?<={mark})|^)[ "]*(?:{pattern})(?=[ "]*(?:{mark}|$))')
