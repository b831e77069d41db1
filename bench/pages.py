"""Tables of measured figures within a page of documentation, between two marks."""

from collections.abc import Iterable, Sequence
from pathlib import Path


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ['---'] * len(head), *rows]
    return '\n'.join(f'| {" | ".join(cells)} |' for cells in lines)


def filled(page: Path, name: str, table: str) -> str:
    """Return the text of a page with the table between its marks made anew.

    The marks are ``<!-- NAME -->`` and ``<!-- end of NAME -->``.

    Raises
    ------
    ValueError
        If the page lacks one of them.
    """
    begin, end = f'<!-- {name} -->', f'<!-- end of {name} -->'
    before, begun, rest = page.read_text(encoding='utf-8').partition(begin)
    _, ended, after = rest.partition(end)
    if not (begun and ended):
        raise ValueError(f'{page}: no place for a table between {begin} and {end}')
    return f'{before}{begin}\n{table}\n{end}{after}'
