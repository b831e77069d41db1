"""A fleet as HTML: a strip for each parameter, with every motor on it, and a table of the motors.

The strip shows each motor with two standard errors either way over a band of two standard
deviations from motor to motor.
"""

from html import escape

import numpy as np

from motor_sysid.diagnosis.result.figures import with_unit
from motor_sysid.fleet.spread import Spread
from motor_sysid.fleet.survey import Fleet, Member

WIDTH, ROW, MARGIN, NAMES, LETTERS = 460, 15, 12, 90, 14

STYLE = """
.strips { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 25rem), 1fr));
  gap: .6rem 1.5rem; }
figure { margin: 0; } figcaption { font-weight: 600; }
figcaption small { font-weight: 400; color: var(--soft-ink); }
svg { width: 100%; height: auto; } svg text { font: 11px system-ui, sans-serif; fill: var(--ink); }
thead th, td { text-align: left; }
.band { fill: var(--head); } .mean { stroke: var(--soft-ink); }
.bar { stroke: var(--soft-ink); } .dot { fill: var(--soft-ink); }
.odd .bar { stroke: var(--bad); } .odd .dot { fill: var(--bad); }
svg .usual text { fill: var(--soft-ink); }
svg .odd text { fill: var(--bad); font-weight: 600; }
ul { margin: 0; padding-left: 1.1rem; } td ul { text-align: left; white-space: normal; }
"""


def body(fleet: Fleet) -> str:
    """Return the body of the page."""
    effects = ', '.join(fleet.effects) or 'none'
    odd = sum(bool(fleet.oddities(one)) for one in fleet.members)
    facts = {'motors': str(len(fleet.members)), 'not like the others': str(odd),
             'motor kind': fleet.motor, 'effects of all': effects}  # fmt: skip
    told = ''.join(f'<dt>{escape(k)}</dt><dd>{escape(v)}</dd>' for k, v in facts.items())
    strips = ''.join(_strip(one) for one in fleet.spreads)
    rows = ''.join(_row(fleet, one) for one in fleet.members)
    return (
        f'<dl>{told}</dl>\n<section>\n<h2>Motors</h2>\n<p>Held-out errors: of the model that each '
        'diagnosis began with, of the one it ended with, and of the model of all.</p>\n'
        '<div class="scroll" tabindex="0" role="region" aria-label="Motors"><table><thead><tr>'
        '<th scope="col">motor</th><th scope="col">its own diagnosis</th><th scope="col">errors'
        '</th><th scope="col">not like the others</th></tr></thead>\n'
        f'<tbody>\n{rows}</tbody></table></div>\n</section>\n<section>\n<h2>Parameters</h2>\n'
        '<p>Each motor with two standard errors, over the band of two standard deviations from '
        f'motor to motor.</p>\n<div class="strips">\n{strips}</div>\n</section>\n'
    )


def _row(fleet: Fleet, one: Member) -> str:
    verdict = one.verdict.value.replace('_', ' ') if one.verdict else 'not judged'
    said = ', '.join(one.effects) or verdict
    errors = ' → '.join(f'{e:.3g} %' for e in one.errors if np.isfinite(e)) or one.reason
    odd = ''.join(f'<li>{escape(text)}</li>' for text in fleet.oddities(one))
    cell = f'<td class="bad text" style="--part:20%"><ul>{odd}</ul></td>' if odd else '<td></td>'
    return (
        f'<tr><th scope="row">{escape(one.name)}</th><td class="text">{escape(said)}</td>'
        f'<td>{escape(errors)}</td>{cell}</tr>\n'
    )


def _strip(spread: Spread) -> str:
    names = list(spread.values)
    value, sigma = (np.array(column) for column in zip(*spread.values.values(), strict=True))
    mean, reach = spread.mean, 2.0 * spread.scatter
    ends = np.array([-reach, reach])
    band = mean * np.exp(ends) if spread.relative else mean + ends
    ends = np.concatenate([value, band, np.clip(value + 2 * sigma, None, value.max() * 2)])
    low, high = float(np.min(ends)), float(np.max(ends))
    room = 0.12 * (high - low) or abs(high) or 1.0
    low, high = low - room, high + room

    def place(x: float) -> float:
        share = float(np.clip((x - low) / (high - low), 0.0, 1.0))
        return NAMES + (WIDTH - NAMES - MARGIN) * share

    height = ROW * len(names) + 2 * MARGIN + 8
    floor = height - 20
    left, right = place(float(band[0])), place(float(band[1]))
    parts = [f'<rect class="band" x="{left:.1f}" y="4" width="{max(right - left, 1):.1f}" '
             f'height="{floor - 4}"/>',
             f'<line class="mean" x1="{place(mean):.1f}" x2="{place(mean):.1f}" y1="4" '
             f'y2="{floor}"/>']  # fmt: skip
    odd = {one.name for one in spread.odd}
    for j, name in enumerate(names):
        parts.append(_mark(name, name in odd, j, *map(place, (
            value[j], value[j] - 2 * sigma[j], value[j] + 2 * sigma[j]))))  # fmt: skip
    for x, anchor in ((low + room, 'start'), (high - room, 'end')):
        where = f'x="{place(x):.1f}" y="{height - 5}" text-anchor="{anchor}"'
        parts.append(f'<text {where}>{escape(with_unit(x, spread.unit))}</text>')
    title = f'{spread.description}, {spread.parameter}'
    usual = f'{with_unit(mean, spread.unit)} ± {_scatter(spread)}'
    return (
        f'<figure><figcaption>{escape(title)} <small>{escape(usual)}</small></figcaption>'
        f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{escape(title)}">'
        f'{"".join(parts)}</svg></figure>\n'
    )


def _mark(name: str, odd: bool, row: int, x: float, left: float, right: float) -> str:
    y = MARGIN + ROW * row
    short = name if len(name) <= LETTERS else f'{name[: LETTERS - 1]}…'
    label = f'<text x="{NAMES - 8}" y="{y + 4}" text-anchor="end">{escape(short)}</text>'
    return (
        f'<g class="{"odd" if odd else "usual"}"><title>{escape(name)}</title><line class="bar" '
        f'x1="{left:.1f}" x2="{right:.1f}" y1="{y}" y2="{y}"/><circle class="dot" cx="{x:.1f}" '
        f'cy="{y}" r="3.5"/>{label}</g>'
    )


def _scatter(spread: Spread) -> str:
    if spread.relative:
        return f'{100 * spread.scatter:.2g} %'
    return with_unit(spread.scatter, spread.unit, 2)
