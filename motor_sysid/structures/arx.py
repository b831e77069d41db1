"""ARX: ``A y = B u + e`` by linear least squares.

(Ljung 1999, sections 4.2 and 10.1.)
"""

from collections.abc import Sequence

from motor_sysid.structures.base import Array, Kind, Numbers, Run
from motor_sysid.structures.polynomial import best_delay, free_run, least_squares, one_ahead


class Arx(Kind):
    """Least squares between samples."""

    key = 'arx'
    title = 'ARX'
    source = 'Ljung, System Identification, 2nd ed. 1999, section 4.2'
    limits = 'linear; biased unless the noise passes through the poles of the motor'
    orders = (1, 2, 3, 4, 6, 10)
    strides = (1, 3, 10, 30)

    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Fit; see `Kind.fit`."""
        return least_squares(runs, order, best_delay(runs)).numbers()

    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Run freely; see `Kind.simulate`."""
        return free_run(numbers, u, start)

    def predict(self, numbers: Numbers, run: Run, dt: float) -> Array:
        """Predict; see `Kind.predict`."""
        return one_ahead(numbers, run)
