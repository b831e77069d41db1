"""Box-Jenkins: ``y = B / F u + C / D e``, motor and noise apart.

(Box and Jenkins 1970.)
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from motor_sysid.structures.base import Array, Kind, Numbers, Run
from motor_sysid.structures.oe import fitted
from motor_sysid.structures.polynomial import errors, free_run, minimized, one_ahead, whitening

_NOISE_ORDER = 2


class BoxJenkins(Kind):
    """Prediction error with a noise model of second order of its own."""

    key = 'bj'
    title = 'Box-Jenkins'
    source = 'Box and Jenkins 1970; Ljung, System Identification, 2nd ed. 1999, section 4.2'
    limits = 'linear'

    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Fit from the output error and an autoregression of what it leaves; see `Kind.fit`."""
        start = fitted(runs, order)
        d = whitening([errors(start, run)[2] for run in runs], _NOISE_ORDER)
        coloured = replace(start, d=d, c=np.zeros(_NOISE_ORDER))
        return minimized(coloured, runs).numbers()

    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Run freely; see `Kind.simulate`."""
        return free_run(numbers, u, start)

    def predict(self, numbers: Numbers, run: Run, dt: float) -> Array:
        """Predict; see `Kind.predict`."""
        return one_ahead(numbers, run)
