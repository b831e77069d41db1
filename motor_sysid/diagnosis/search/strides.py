"""Fits where derivatives over a hair lead nowhere: derivatives over longer strides.

Where a current chatters about the sign of its brushes, or a rotor sticks and slips, the outputs
are rough on every scale: over a hair a few samples jump, and a fit ends where those hold it, far
above the least sum of squares.  Differences over a stride see past them.  (Ralston and Jennrich
1978, Technometrics 20, for secants in place of derivatives.)
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.further import RESTLESS
from motor_sysid.diagnosis.search.refit import chatters
from motor_sysid.diagnosis.search.rung import judge, leaves_much, Rung, SPOILED
from motor_sysid.estimation.batch import Linearization, Problem, Weighting
from motor_sysid.estimation.batch.least_squares import (
    newton_step,
    normal_equations,
    result_at,
    Solution,
)

Array = NDArray[np.float64]

STRIDES = (1e-1, 1e-2)
"""Strides in scaled coordinates, the longest first."""

MOST = 6
"""Most steps with each."""

SHARES = np.array([1.0, 0.5, 0.25])
"""Shares of a step that are tried."""

WORTH = 4.0
"""Fall of the whitened sum of squares that is worth a step: two standard errors."""


def freed(rung: Rung, bench: Bench) -> Rung:
    """Return a fit that much is left of, followed over strides if a sign of the current holds it.

    Parameters that make up for where it is held (an inductance twice too large) look like another
    missing effect.
    """
    held = chatters(rung.model) and leaves_much(rung, bench, RESTLESS)
    return strode(rung, bench) if held else rung


def strode(rung: Rung, bench: Bench) -> Rung:
    """Return a fit followed over longer strides while its error falls; itself where it does not.

    Its derivatives are then those over the longest stride that led.  It stays as well where that
    does the held-out error harm.
    """
    problem, weighting = bench.problem(rung.model), rung.result.weighting
    z, led, steps, settled = problem.vector(), 0.0, 0, False
    seen: dict[float, Sequence[Linearization]] = {}
    for stride in STRIDES:
        for _ in range(MOST):
            seen[stride] = problem.linearize(z, stride=stride)
            there = _step(problem, weighting, z, seen[stride])
            settled = there is None
            if there is None:
                break
            z, led, steps, seen = there, max(led, stride), steps + 1, {}
    if not steps:
        return rung
    near = tuple(seen.get(led) or problem.linearize(z, stride=led))
    cost = normal_equations(near, weighting)[2]
    runs = (steps + len(STRIDES)) * (2 * z.size + 1) + steps * SHARES.size
    at = Solution(z, cost, settled, steps, runs, near)
    found = judge(result_at(problem, weighting, at, runs, steps), bench, near)
    return found if found.held.error_percent < SPOILED * rung.held.error_percent else rung


def _step(
    problem: Problem, weighting: Weighting, z: Array, near: Sequence[Linearization]
) -> Array | None:
    """Return the best of the places (d,) that derivatives at one lead to, if worth it."""
    gradient, curvature, cost = normal_equations(near, weighting)
    move = newton_step(gradient, curvature)
    if not float(move @ gradient) > WORTH:  # or not a number
        return None
    trials: Array = np.clip(z + SHARES[:, np.newaxis] * move, *problem.box())
    costs = problem.costs(trials, weighting, near)
    best = int(np.argmin(costs))
    return trials[best] if costs[best] < cost - WORTH else None
