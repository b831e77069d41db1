"""Hammerstein: a static bend, then a linear block.

See `motor_sysid.structures.bends`.
"""

from collections.abc import Sequence

from motor_sysid.structures import bends
from motor_sysid.structures.base import Array, Kind, Numbers, Run


class Hammerstein(Kind):
    """A bend of the input."""

    key = 'hammerstein'
    title = 'Hammerstein'
    source = 'Bai, Automatica 1998'
    limits = 'one static bend of the input: dead zone, saturation'
    orders = (1, 2)

    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Fit; see `Kind.fit`."""
        return bends.fit(runs, order, before=True, after=False)

    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Run freely; see `Kind.simulate`."""
        return bends.simulate(numbers, u, start)
