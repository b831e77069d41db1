"""Live progress of a running loop: a table on a terminal, lines elsewhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import math
import time
from typing import TextIO, TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

    from motor_sysid.nodes.monitor import Estimated, Snapshot

LINE_PERIOD = 2.0
"""Time between two lines where the output is no terminal, s."""
NAMES = {'velocity': ('speed', 'rad/s'), 'effort': ('current', 'A')}
"""Field of ~/residual to what it is."""


Show = Callable[['Snapshot'], None]


@contextmanager
def live_progress(seconds: float, stream: TextIO) -> Iterator[Show]:
    """Yield a function that shows a snapshot; it may be called as often as one likes."""
    try:
        from rich.console import Console
        from rich.live import Live
    except ImportError:
        yield _lines(seconds, stream)
        return
    console = Console(file=stream)
    if not console.is_terminal:
        yield _lines(seconds, stream)
        return
    with Live(console=console, refresh_per_second=8) as live:
        yield lambda snapshot: live.update(_table(snapshot, seconds))


def _lines(seconds: float, stream: TextIO) -> Show:
    due = [0.0]

    def show(snapshot: 'Snapshot') -> None:
        now = time.monotonic()
        if now >= due[0] or snapshot.elapsed >= seconds:
            due[0] = now + LINE_PERIOD
            stream.write(_line(snapshot, seconds) + '\n')
            stream.flush()

    return show


def _line(snapshot: 'Snapshot', seconds: float) -> str:
    parts = [
        f'{min(snapshot.elapsed, seconds):5.1f} s',
        f'speed {snapshot.speed:7.1f} of {snapshot.reference:7.1f} rad/s',
        f'tracking {snapshot.tracking:5.1f}',
    ]
    parts += [f'{label} error {text}' for label, text in _errors(snapshot)]
    parts += [f'{name} {_value(found)}' for name, found in snapshot.estimates.items()]
    parts += [f'live verdict: {snapshot.verdict}'] if snapshot.verdict else []
    return ' | '.join(parts)


def _errors(snapshot: 'Snapshot') -> list[tuple[str, str]]:
    return [
        (NAMES[name][0], f'{rms:.3g} {NAMES[name][1]}')
        for name, rms in snapshot.errors.items()
        if math.isfinite(rms)
    ]


def _value(found: 'Estimated') -> str:
    if not found.identifiable:
        return f'{found.value:.3g} {found.unit} (not identifiable yet)'
    return f'{found.value:.4g} ± {found.sigma:.1g} {found.unit}'


def _table(snapshot: 'Snapshot', seconds: float) -> 'Table':
    from rich.table import Table

    done = min(snapshot.elapsed / seconds, 1.0)
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(min_width=16)
    table.add_column()
    bar = '━' * round(30 * done) + '╌' * (30 - round(30 * done))
    table.add_row('time', f'{bar} {min(snapshot.elapsed, seconds):.1f} of {seconds:g} s')
    table.add_row('speed', f'{snapshot.speed:.1f} rad/s (reference {snapshot.reference:.1f})')
    table.add_row('tracking error', f'{snapshot.tracking:.2f} rad/s')
    for label, text in _errors(snapshot):
        table.add_row(f'{label} prediction', f'error {text}')
    for name, found in snapshot.estimates.items():
        table.add_row(name, _value(found), style='' if found.identifiable else 'dim')
    table.add_row('live verdict', snapshot.verdict or 'none yet')
    return table
