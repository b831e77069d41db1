"""OE: ``y = B / F u + e`` by its output error, started by Steiglitz and McBride's iteration."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from motor_sysid.structures.base import Array, Kind, Numbers, Run
from motor_sysid.structures.polynomial import (
    best_delay,
    free_run,
    minimized,
    Polynomials,
    reflected,
    steiglitz_mcbride,
)


class OutputError(Kind):
    """Output error between samples."""

    key = 'oe'
    title = 'output error'
    source = 'Ljung, System Identification, 2nd ed. 1999, section 4.2'
    limits = 'linear; noise is white at the output'

    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Fit; see `Kind.fit`."""
        return fitted(runs, order).numbers()

    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Run freely; see `Kind.simulate`."""
        return free_run(numbers, u, start)


def fitted(runs: Sequence[Run], order: int) -> Polynomials:
    """Return ``B / F`` with the smallest output error."""
    start = steiglitz_mcbride(runs, order, best_delay(runs))
    if not start.f.size:
        start = replace(start, a=np.zeros(0), f=reflected(start.a))
    return minimized(start, runs)
