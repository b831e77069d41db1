"""Hammerstein-Wiener: static bends on both sides of a linear block.

See `motor_sysid.structures.bends`.
"""

from collections.abc import Sequence

from motor_sysid.structures import bends
from motor_sysid.structures.base import Array, Kind, Numbers, Run


class HammersteinWiener(Kind):
    """Bends of input and output."""

    key = 'hammerstein_wiener'
    title = 'Hammerstein-Wiener'
    source = 'Bai, Automatica 1998'
    limits = 'static bends outside of the loop of the motor: friction is none'
    orders = (1, 2)

    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Fit; see `Kind.fit`."""
        return bends.fit(runs, order, before=True, after=True)

    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Run freely; see `Kind.simulate`."""
        return bends.simulate(numbers, u, start)
