"""Transfer function in continuous time with a delay, fitted by its output error.

    y = e^(-s delay) num(s) / den(s) u + constant + white noise

Poles are added one by one: each order starts from the one below and from a pole at every time
constant of a grid.  (Garnier and Wang, Identification of Continuous-time Models from Sampled
Data, 2008, chapter 4; Ljung 1999, section 4.3.)
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from motor_sysid.structures.base import Array, Kind, Numbers, Run
from motor_sysid.structures.block import denominator, discretized, projected, responses, settled

_GRID = 7
_LONGEST = 0.3
_LATEST = 25.0
_TRIES = (0.0, 1.0, 3.0, 8.0)
_MOST = 40
_ROWS = 1500


class TransferFunction(Kind):
    """Transfer functions of order 1 to 4."""

    key = 'tf'
    title = 'transfer function with delay'
    source = 'Ljung, System Identification, 2nd ed. 1999, section 4.3'
    limits = 'linear; noise is white at the output'

    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Fit; see `Kind.fit`."""
        poles, delay = search(runs, order)
        numerator, _ = projected(poles, delay, runs)
        return {'poles': poles, 'delay': np.array([delay]), 'numerator': numerator}

    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Run freely; see `Kind.simulate`."""
        block = discretized(numbers['poles'], float(numbers['delay'][0]))
        forced = responses(block, u) @ numbers['numerator']
        return settled(block, forced, start)[:, np.newaxis]


def search(runs: Sequence[Run], order: int) -> tuple[Array, float]:
    """Return the best poles (n,), as `block` has them, and the delay in samples.

    The way there looks at some of the rows, the last step at all of them.
    """
    longest = _LONGEST * max(len(run) for run in runs)
    rates = np.log(1 / np.geomspace(0.5, max(longest, 2.0), _GRID))
    every = max(sum(map(len, runs)) // _ROWS, 1)
    best: tuple[Array, float] | None = None
    for n in range(1, order + 1):
        starts = [(one, late) for one in _longer(best, n, rates) for late in _late(best, n)]
        costs = [np.mean(projected(*one, runs, every)[1] ** 2) for one in starts]
        best = refined(*starts[int(np.argmin(costs))], runs, every)
    assert best is not None
    return refined(*best, runs) if every > 1 else best


def _longer(best: tuple[Array, float] | None, n: int, rates: Array) -> list[Array]:
    """Return start poles of order n: those of order n - 1 and one more."""
    if best is None:
        return [np.array([rate]) for rate in rates]
    old = best[0]
    if n % 2:  # (s^2 + ..)(s + d)
        return [np.append(old, rate) for rate in rates]
    pairs = []
    for rate in rates:  # the single pole and the new one become a pair
        one, two = np.exp(old[-1]), np.exp(rate)
        pairs.append(np.append(old[:-1], [np.log(one + two), old[-1] + rate]))
    return pairs


def _late(best: tuple[Array, float] | None, n: int) -> tuple[float, ...]:
    return _TRIES if best is None or n == 2 else (best[1],)


def refined(
    poles: Array, delay: float, runs: Sequence[Run], every: int = 1
) -> tuple[Array, float]:
    """Return poles and delay at the nearest minimum of the squared error."""
    n = poles.size
    lower = np.append(np.full(n, -60.0), 0.0)
    upper = np.append(np.full(n, 6.0), _LATEST)

    def residual(z: Array) -> Array:
        return projected(z[:n], float(z[n]), runs, every)[1]

    found = least_squares(
        residual,
        np.clip(np.append(poles, delay), lower, upper),
        bounds=(lower, upper), diff_step=np.full(n + 1, 1e-4), max_nfev=_MOST,
        xtol=1e-7, ftol=1e-7,
    )  # fmt: skip
    z = np.asarray(found.x)
    return z[:n], float(z[n])


def words(numbers: Numbers, dt: float) -> str:
    """Return poles in rad/s and delay in s, for people."""
    roots = np.roots(denominator(numbers['poles'])) / dt
    listed = ', '.join(f'{r.real:.4g}' + (f'{r.imag:+.4g}j' if r.imag else '') for r in roots)
    return f'poles {listed} rad/s, delay {float(numbers["delay"][0]) * dt:.4g} s'
