"""What the benchmark shows on a terminal: how far it is, and its tables."""

import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from motor_sysid.benchmark.outcome import Result
    from motor_sysid.benchmark.tables import Table

LINE_PERIOD = 10.0
"""Time between two lines where stderr is no terminal, s."""


class Watch:
    """Tells each result, and when the end is to be expected; a context manager."""

    def __init__(self, total: int, *, goes_on: bool = True) -> None:
        self._begun = time.monotonic()
        self._new, self._due = 0, 0.0
        self._live = sys.stderr.isatty()
        self._total, self._goes_on = total, goes_on

    def __call__(self, result: 'Result', done: int, total: int) -> None:
        """Take one more result of the diagnosis."""
        self.tell(
            f'{result.case}: {result.answer} ({result.outcome.value}, {result.seconds:.1f} s)',
            done, total,
        )  # fmt: skip

    def tell(self, what: str, done: int, total: int) -> None:
        """Say what is done, how far it is, and how long the rest may take."""
        self._new += 1
        now = time.monotonic()
        last = done == total
        if not self._live and now < self._due and not last:
            return
        self._due = now + LINE_PERIOD
        left = (now - self._begun) / self._new * (total - done)
        text = f'{done}/{total}  {_duration(left)} left  {what}'
        if self._live:
            sys.stderr.write(f'\r\x1b[2K{text}')
        else:
            sys.stderr.write(f'{text}\n')
        sys.stderr.flush()

    def __enter__(self) -> 'Watch':
        """Say that it starts."""
        print(f'{self._total} tasks; workers start and compile ...', file=sys.stderr, flush=True)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the line; after an interruption say how to go on, where that is possible."""
        if self._live:
            sys.stderr.write('\n')
        if kind is KeyboardInterrupt and self._goes_on:
            print('stopped; the same command goes on from here', file=sys.stderr)


def print_table(table: 'Table') -> None:
    """Print a table as wide as it needs to be where the output is a file."""
    from rich.console import Console
    from rich.table import Table as RichTable

    console = Console()
    shown = RichTable(title=table.title, title_justify='left', caption=table.note)
    for k, name in enumerate(table.head):
        shown.add_column(name, justify='left' if k == 0 else 'right')
    colours = {'good': 'green', 'bad': 'red', 'soft': 'yellow', '': ''}
    for row in table.rows:
        shown.add_row(*[
            f'[{colours[c.tone]}]{c.text}[/]' if colours[c.tone] and c.text else c.text
            for c in row
        ])  # fmt: skip
    if not console.is_terminal:
        console = Console(width=160)
    console.print(shown)


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f'{seconds:.0f} s'
    minutes = seconds / 60
    return f'{minutes:.0f} min' if minutes < 90 else f'{minutes / 60:.1f} h'
