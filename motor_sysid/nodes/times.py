"""Percentiles of working times, without keeping the times."""

import math

SHORTEST, GROWTH, BINS = 1e-6, math.log(1.05), 380
"""Shortest time that is told apart (s), logarithmic width of a bin, bins: up to 100 s."""


class Times:
    """Working times in bins that grow by 5 %: any number of them, in a fixed amount of memory."""

    def __init__(self) -> None:
        self._counts = [0] * BINS
        self.longest = 0.0

    def add(self, seconds: float) -> None:
        """Count one time."""
        bin_number = int(math.log(max(seconds, SHORTEST) / SHORTEST) / GROWTH)
        self._counts[min(bin_number, BINS - 1)] += 1
        self.longest = max(self.longest, seconds)

    def percentile(self, share: float) -> float:
        """Return the time in s that this share (0 to 1) does not exceed, to 5 %; NaN if none."""
        total, seen = sum(self._counts), 0
        for k, count in enumerate(self._counts):
            seen += count
            if seen and seen >= share * total:
                return min(SHORTEST * math.exp((k + 1) * GROWTH), self.longest)
        return math.nan
