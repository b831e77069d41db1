"""Wiener: a linear block, then a static bend.

See `motor_sysid.structures.bends`.
"""

from collections.abc import Sequence

from motor_sysid.structures import bends
from motor_sysid.structures.base import Array, Kind, Numbers, Run


class Wiener(Kind):
    """A bend of the output."""

    key = 'wiener'
    title = 'Wiener'
    source = 'Billings and Fakhouri, Automatica 1982'
    limits = 'one static bend of the output: sensors, saturation'
    orders = (1, 2)

    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Fit; see `Kind.fit`."""
        return bends.fit(runs, order, before=False, after=True)

    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Run freely; see `Kind.simulate`."""
        return bends.simulate(numbers, u, start)
