"""The report as one self-contained HTML page, light and dark."""

from collections.abc import Mapping, Sequence
from html import escape

from motor_sysid.benchmark.equivalences import EQUIVALENCES
from motor_sysid.benchmark.outcome import Result
from motor_sysid.benchmark.style import STYLE
from motor_sysid.benchmark.tables import Cell, Table, tables

TITLE = 'Benchmark of the diagnosis'

_LONG = 32
"""Letters from which a cell is wrapped."""


def page(results: Sequence[Result], facts: Mapping[str, str]) -> str:
    """Return the page.

    Parameters
    ----------
    results:
        Every case.
    facts:
        What else to say of the run: seed, state of the program ...
    """
    parts = [section(table) for table in tables(results)]
    return whole(TITLE, f'{_facts(results, facts)}\n{"".join(parts)}{_equivalences()}')


def whole(title: str, body: str, style: str = '') -> str:
    """Return a page of its own with a heading, a body in HTML and more rules for its style."""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{escape(title)}</title>\n<style>{STYLE}{style}</style>\n</head>\n<body>\n'
        f'<main>\n<h1>{escape(title)}</h1>\n{body}</main>\n</body>\n</html>\n'
    )


def _facts(results: Sequence[Result], facts: Mapping[str, str]) -> str:
    every = {'cases': str(len(results)), **facts}
    items = ''.join(f'<dt>{escape(k)}</dt><dd>{escape(v)}</dd>' for k, v in every.items())
    return (
        '<p>Motors from data sheets, simulated with real sensors by a simulator that shares '
        'nothing with the models that are fitted; an effect is hidden in most of them.</p>\n'
        f'<dl>{items}</dl>'
    )


def section(table: Table) -> str:
    """Return a table with its heading as HTML."""
    matrix = ' class="matrix"' if table.title.startswith('Confusion') else ''
    head = ''.join(f'<th scope="col"><span>{escape(title)}</span></th>' for title in table.head)
    rows = ''.join(
        f'<tr><th scope="row"{_wrapped(first)}>{escape(first.text)}</th>'
        f'{"".join(map(_cell, rest))}</tr>\n'
        for first, *rest in table.rows
    )
    return (
        f'<section>\n<h2>{escape(table.title)}</h2>\n<p>{escape(table.note)}</p>\n'
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(table.title)}">'
        f'<table{matrix}>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table></div>\n'
        '</section>\n'
    )


def _cell(cell: Cell) -> str:
    if not cell.tone:
        return f'<td{_wrapped(cell)}>{escape(cell.text)}</td>'
    least = 35 if cell.tone == 'bad' else 12  # a single wrong name must be seen
    strength = round(least + (60 - least) * cell.weight)
    return f'<td class="{cell.tone}" style="--part:{strength}%">{escape(cell.text)}</td>'


def _wrapped(cell: Cell) -> str:
    """Have a long text broken into lines: the columns behind it are to be seen, too."""
    return ' class="text"' if len(cell.text) > _LONG else ''


def _equivalences() -> str:
    rows = ''.join(
        f'<tr><th scope="row">{escape(_set(e.one))}</th><td>{escape(_set(e.other))}</td>'
        f'<td class="text">{escape(e.reason)}</td></tr>\n'
        for e in EQUIVALENCES
    )
    return (
        '<section>\n<h2>What no record can tell apart</h2>\n<p>Who names one side where the other '
        'is hidden is right.</p>\n<div class="scroll" tabindex="0" role="region" '
        'aria-label="Equivalences"><table>\n<thead><tr><th scope="col">this</th><th scope="col">'
        f'is the same as</th><th scope="col">because</th></tr></thead>\n<tbody>\n{rows}</tbody>\n'
        '</table></div>\n</section>\n'
    )


def _set(effects: frozenset[str]) -> str:
    return ' + '.join(sorted(effects)) or 'complete'
