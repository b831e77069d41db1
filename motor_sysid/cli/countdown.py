"""How far many equal pieces of work are, and when the end is to be expected."""

import sys
import time
from types import TracebackType

LINE_PERIOD = 10.0
"""Time between two lines where stderr is no terminal, s."""


class Countdown:
    """Tells on stderr how many are done; a context manager."""

    def __init__(self, total: int, what: str) -> None:
        self._total, self._what = total, what
        self._begun, self._due = time.monotonic(), 0.0
        self._live = sys.stderr.isatty()

    def __call__(self, done: int) -> None:
        """Tell that so many are done."""
        now = time.monotonic()
        if not self._live and now < self._due and done < self._total:
            return
        self._due = now + LINE_PERIOD
        left = (now - self._begun) / max(done, 1) * (self._total - done)
        text = f'  {done}/{self._total} {self._what}, {left:.0f} s left'
        sys.stderr.write(f'\r\x1b[2K{text}' if self._live else f'{text}\n')
        sys.stderr.flush()

    def __enter__(self) -> 'Countdown':
        """Say that it starts."""
        print(f'  {self._total} {self._what}; workers start ...', file=sys.stderr, flush=True)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the line."""
        if self._live:
            sys.stderr.write('\n')
