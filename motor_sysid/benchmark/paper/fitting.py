"""The recommended fit: no start value, no bounds; and the least-squares polish of any candidate.

The plant integrated twice, ``y = -a1 Iy - a0 IIy + b IIu(t - tau)``, is linear in all but the
delay (integrals in place of derivatives: noise is averaged).  So the best coefficients are found
for each delay of a grid, and the best delays start an output-error fit, which is what the noise
asks for.
(Young 1981, doi:10.1016/0005-1098(81)90082-0, for equation errors; Ljung 1999, section 7.4.)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from motor_sysid.benchmark.paper.control import DT
from motor_sysid.benchmark.paper.plant import SEEN, seen, whole
from motor_sysid.benchmark.paper.studies import Study
from motor_sysid.estimation.batch.information import Information, information

Array = NDArray[np.float64]

GRID = 60
"""Delays that are tried."""

LONGEST = 0.5
"""Part of the record that a delay may take."""

_STARTS, _BRIEF, _MOST, _FARTHEST = 3, 8, 60, 25.0
_STEP = np.array([1e-5, 1e-5, 1e-5, 1e-5])


@dataclass(frozen=True)
class Fitted:
    """Result of a fit.

    Attributes
    ----------
    candidate:
        (5,) with a2 = 1.
    sigma:
        (4,) standard deviations of what is `seen`.
    cost:
        Sum of squared errors.
    simulations:
        How many it took.
    """

    candidate: Array
    sigma: Array
    cost: float
    simulations: int


def recommended(study: Study) -> Fitted:
    """Fit a record whose input is known, from nothing."""
    fits = [polish(study, start, steps=_BRIEF) for start in profiled(study)]
    nearest = min(fits, key=lambda fit: fit.cost)
    best = polish(study, nearest.candidate)
    total = best.simulations + sum(fit.simulations for fit in fits)
    return Fitted(best.candidate, best.sigma, best.cost, total)


def profiled(study: Study) -> list[Array]:
    """Return the best (5,) starts over a grid of delays: those of the lowest valleys."""
    time, u, y = study.time, study.drive, study.measured
    once = _integrated(y)
    twice = _integrated(once)
    steps = np.concatenate([[0.0], np.cumsum(u)[:-1]]) * DT
    given = np.concatenate([[0.0], np.cumsum(steps + 0.5 * DT * u)[:-1]]) * DT
    delays = np.linspace(0.0, LONGEST * time[-1], GRID)
    fits, costs = [], []
    for tau in delays:
        late = np.interp(time - tau, time, given, left=0.0)
        columns = np.column_stack([-once, -twice, late])
        numbers = np.linalg.lstsq(columns, y, rcond=None)[0]
        fits.append(numbers)
        costs.append(float(np.sum((y - columns @ numbers) ** 2)))
    wall = np.concatenate([[np.inf], costs, [np.inf]])
    valleys = np.flatnonzero((wall[1:-1] <= wall[:-2]) & (wall[1:-1] <= wall[2:]))
    best = sorted(valleys, key=lambda k: costs[k])[:_STARTS]
    least = 1e-3
    return [
        whole(np.array([max(fits[k][1], least), max(fits[k][0], least), max(fits[k][2], least),
                        delays[k]]))
        for k in best
    ]  # fmt: skip


def _integrated(values: Array) -> Array:
    """Return the integral (N,) of (N,) from the start, by trapezoids."""
    found: Array = np.append(0.0, np.cumsum(0.5 * DT * (values[1:] + values[:-1])))
    return found


def polish(study: Study, start: Array, *, steps: int = _MOST) -> Fitted:
    """Minimize the output error from a candidate (5,) over a0, a1, b (a2 = 1) and the delay."""
    count = 0

    def errors(z: Array) -> Array:
        nonlocal count
        count += 1
        found: Array = study.errors(_candidates(z[np.newaxis, :]))[0]
        return np.nan_to_num(found, nan=1e6, posinf=1e6, neginf=-1e6)

    def slopes(z: Array) -> Array:
        nonlocal count
        count += 8
        return -_slopes(study, z)

    longest = LONGEST * float(study.time[-1])
    first = _coordinates(start)
    far = np.array([_FARTHEST] * 3)
    low, high = np.append(-far, 0.0), np.append(far, longest)
    first = np.clip(first, low + 1e-6, high - 1e-6)
    with np.errstate(all='ignore'):
        found = least_squares(errors, first, slopes, bounds=(low, high), x_scale='jac',
                              ftol=1e-10, xtol=1e-13, gtol=1e-15, max_nfev=steps)  # fmt: skip
    candidate = _candidates(found.x[np.newaxis, :])[0]
    cost = 2.0 * float(found.cost)
    noise = np.sqrt(cost / max(study.measured.size - 4, 1))
    told = told_by(study, candidate, max(noise, 1e-300))
    return Fitted(candidate, told.bound, cost, count)


def told_by(study: Study, candidate: Array, sigma: float) -> Information:
    """Return the information of a study on what is `seen`, with white noise of that size."""
    z = _coordinates(candidate)
    scale = np.append(np.exp(z[:3]), 1.0)
    return information(_slopes(study, z) / sigma, SEEN, scale)


def _coordinates(candidate: Array) -> Array:
    """Return logarithms of a0, a1, b over a2, and the delay."""
    four = seen(candidate)
    return np.append(np.log(np.maximum(four[:3], 1e-12)), four[3])


def _candidates(z: Array) -> Array:
    """Return (P, 5) candidates of (P, 4) coordinates."""
    return whole(np.column_stack([np.exp(np.clip(z[:, :3], -30, 30)), np.maximum(z[:, 3], 0)]))


def _slopes(study: Study, z: Array) -> Array:
    """Return the derivatives (N, 4) of the simulated output by the coordinates."""
    moves = np.vstack([np.diag(_STEP), -np.diag(_STEP)])
    runs = study.simulate(_candidates(np.maximum(z + moves, [-30, -30, -30, 0])))
    width = np.where(z[3] < _STEP[3], [2, 2, 2, 1 + z[3] / _STEP[3]], 2.0) * _STEP
    found: Array = (runs[:4] - runs[4:]).T / width
    return np.nan_to_num(found)
