"""Shares with their confidence limits."""

from dataclasses import dataclass

import numpy as np

_Z = 1.959964


@dataclass(frozen=True)
class Share:
    """How often something happened.

    Attributes
    ----------
    count, total:
        Times that it did, of how many.
    """

    count: int
    total: int

    @property
    def value(self) -> float:
        """The share, 0 to 1; NaN where nothing was tried."""
        return self.count / self.total if self.total else float('nan')

    @property
    def limits(self) -> tuple[float, float]:
        """95 % limits after Wilson (1927, doi:10.1080/01621459.1927.10502953)."""
        if not self.total:
            return 0.0, 1.0
        n, p = self.total, self.value
        centre = (p + _Z**2 / (2 * n)) / (1 + _Z**2 / n)
        half = _Z * np.sqrt(p * (1 - p) / n + _Z**2 / (4 * n**2)) / (1 + _Z**2 / n)
        return max(float(centre - half), 0.0), min(float(centre + half), 1.0)

    @property
    def brief(self) -> str:
        """Count and share in percent; empty where nothing was tried."""
        return f'{self.count}/{self.total} ({100 * self.value:.0f} %)' if self.total else ''

    def __str__(self) -> str:
        """Return count, share and limits for a table."""
        if not self.total:
            return '-'
        low, high = self.limits
        return (
            f'{self.count}/{self.total} = {100 * self.value:.1f} % '
            f'[{100 * low:.1f}, {100 * high:.1f}]'
        )
