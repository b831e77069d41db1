"""Charts of the page: every run a dot on a logarithmic axis, the paper's range a bar."""

from collections.abc import Mapping, Sequence
from html import escape
import math

import numpy as np

from motor_sysid.benchmark.paper.methods import METHODS
from motor_sysid.benchmark.paper.published import CLOSED, OPEN, Printed
from motor_sysid.benchmark.paper.runs import grouped, Run
from motor_sysid.benchmark.paper.studies import READINGS

_LEFT, _WIDTH, _ROW, _TOP = 310, 1000, 22, 18
_LEAST = 1e-16

STYLE = """
svg { width: 100%; max-width: 960px; height: auto; font-size: 12px; }
svg text { fill: var(--ink); } svg .grid { stroke: var(--line); }
svg .dot { fill: var(--good); fill-opacity: .55; }
svg .middle { stroke: var(--ink); stroke-width: 2; }
svg .paper { stroke: var(--bad); stroke-width: 5; stroke-opacity: .45; }
"""


def charts(runs: Sequence[Run]) -> str:
    """Return the charts as HTML: ITAE of the readings, then errors on records at 30 dB."""
    groups, parts = grouped(list(runs)), []
    for key, reading in READINGS.items():
        mine = {m: [r.itae for r in g] for (s, m), g in groups.items() if s == key}
        printed = OPEN if key == 'R1' else CLOSED if key == 'R2' else {}
        parts.append(_chart(reading.title + ': ITAE', mine, printed))
    for data in ('D1', 'D2', 'D3', 'D4'):
        mine = {m: [r.worst for r in g] for (s, m), g in groups.items() if s == f'{data}@30'}
        parts.append(_chart(f'{data} at 30 dB: worst error, percent', mine, {}))
    return ''.join(parts)


def _chart(title: str, values: Mapping[str, list[float]], printed: Mapping[str, Printed]) -> str:
    rows = [m for m in METHODS if m in values]
    if not rows:
        return ''
    every = [max(v, _LEAST) for m in rows for v in values[m]]
    low = math.floor(math.log10(min(every)))
    high = math.ceil(math.log10(max([*every, *(p.most for p in printed.values())])))

    def at(value: float) -> float:
        part = (math.log10(max(value, _LEAST)) - low) / max(high - low, 1)
        return _LEFT + part * (_WIDTH - _LEFT - 20)

    height = _TOP + _ROW * len(rows) + 24
    marks = [
        f'<line class="grid" x1="{at(10.0**e):.1f}" x2="{at(10.0**e):.1f}" y1="{_TOP}" '
        f'y2="{height - 20}"/><text x="{at(10.0**e):.1f}" y="{height - 6}" '
        f'text-anchor="middle">1e{e}</text>'
        for e in range(low, high + 1, max((high - low) // 8, 1))
    ]
    for k, method in enumerate(rows):
        y = _TOP + _ROW * (k + 0.5)
        marks.append(_row(method, values[method], printed, y, at))
    return (
        f'<section><h2>{escape(title)}</h2><p>Dots: seeds; stroke: their median; wide bar: '
        'smallest to largest value that the paper prints.</p>'
        f'<svg viewBox="0 0 {_WIDTH} {height}" role="img" '
        f'aria-label="{escape(title)}">{"".join(marks)}</svg></section>\n'
    )  # fmt: skip


def _row(
    method: str, values: Sequence[float], printed: Mapping[str, Printed], y: float, at: object
) -> str:
    assert callable(at)
    column = '' if method.endswith('polished') else METHODS[method].column
    bar = ''
    if column in printed:
        one = printed[column]
        least = one.mean if math.isnan(one.least) else one.least
        ends = f'x1="{at(least):.1f}" x2="{at(one.most):.1f}"'
        bar = f'<line class="paper" {ends} y1="{y}" y2="{y}"/>'
    dots = ''.join(f'<circle class="dot" cx="{at(v):.1f}" cy="{y}" r="3"/>' for v in values)
    middle = at(float(np.median(values)))
    return (
        f'<text x="{_LEFT - 8}" y="{y + 4}" text-anchor="end">'
        f'{escape(METHODS[method].title)}</text>{bar}{dots}'
        f'<line class="middle" x1="{middle:.1f}" x2="{middle:.1f}" y1="{y - 8}" y2="{y + 8}"/>'
    )
