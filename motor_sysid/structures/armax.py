"""ARMAX: ``A y = B u + C e`` by its prediction error.

(Astrom and Bohlin 1965; Ljung 1999, section 4.2.)
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from motor_sysid.structures.base import Array, Kind, Numbers, Run
from motor_sysid.structures.polynomial import (
    best_delay,
    free_run,
    least_squares,
    minimized,
    one_ahead,
    reflected,
    steiglitz_mcbride,
)


class Armax(Kind):
    """Prediction error with a moving average of the noise."""

    key = 'armax'
    title = 'ARMAX'
    source = 'Astrom and Bohlin 1965; Ljung, System Identification, 2nd ed. 1999, section 4.2'
    limits = 'linear; noise and motor share their poles'
    strides = (1, 3, 10)

    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Fit from ARX and from an output error, whose noise is ``C = A``; see `Kind.fit`."""
        delay = best_delay(runs)
        plain = least_squares(runs, order, delay)
        start = replace(plain, c=np.zeros(order))
        out = steiglitz_mcbride(runs, order, delay)
        poles = out.f if out.f.size else reflected(out.a)
        other = replace(plain, a=poles, b=out.b, c=poles.copy())
        tried = [minimized(one, runs) for one in (start, other)]
        return min(tried, key=lambda p: _cost(p.numbers(), runs)).numbers()

    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Run freely; see `Kind.simulate`."""
        return free_run(numbers, u, start)

    def predict(self, numbers: Numbers, run: Run, dt: float) -> Array:
        """Predict; see `Kind.predict`."""
        return one_ahead(numbers, run)


def _cost(numbers: Numbers, runs: Sequence[Run]) -> float:
    with np.errstate(over='ignore', invalid='ignore'):
        total = sum(float(np.sum((run.y - one_ahead(numbers, run)) ** 2)) for run in runs)
    return total if np.isfinite(total) else np.inf
