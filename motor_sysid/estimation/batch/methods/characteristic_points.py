"""Characteristic points of steps: what a technician reads from a scope, as start values.

From every step of the input between two settled stretches are read

    the change of each measured state (no-load speed, current at rest and at no load),
    the time in which the speed does 63 % of it (the mechanical time constant),
    the peak of the current (close to the stall current) and its time (the electrical one),

each per unit of input.  The same points are read from the step response of the linear core of the
model, and its parameters are moved until both agree: no formula is needed that neglects one time
constant beside the other.  Effects keep their values: they are what the fit that follows is for.
(Ogata, Modern Control Engineering, 5th ed. 2010, section 5.3, on such points; Krishnan, Electric
Motor Drives, 2001, chapter 2, on the time constants.)
"""

from collections.abc import Iterator, Sequence
import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.least_squares import fit as fit_output_error
from motor_sysid.estimation.batch.methods.sampled import Core, one_rate, response
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

KEY = 'characteristic_points'

_JUMP, _QUIET = 0.15, 0.03
"""A step is at least this part of the range of the input, and what is held moves less."""
_SETTLED = 0.08
"""Largest change within the last third of a stretch, over the whole change."""
_SHORTEST = 12
_OVERSHOOT = 1.15
_RISE = 1.0 - math.exp(-1.0)
_REACH = math.log(1e3)


def fit(problem: Problem) -> FitResult:
    """Fit the output error from what the characteristic points say."""
    return fit_output_error(begun(problem))


def begun(problem: Problem) -> Problem:
    """Return the problem with a model that has the characteristic points of its records.

    Raises
    ------
    UserError
        If the motor is not linear, or the records hold no step between two settled stretches.
    """
    core = Core.of(problem.model, KEY)
    records = [stretch.record for stretch in problem.stretches]
    dt = one_rate(records, KEY)
    steps = [step for record in records for step in _steps(*core.measured(record))]
    if not steps:
        raise UserError(
            f'`{KEY}` found no step of {" or ".join(problem.model.kind.inputs[0])} that was held '
            'until the motor settled; record steps that last five time constants'
        )
    model = _matched(problem, core, steps, dt)
    return Problem(
        model, problem.chains, problem.outputs, substeps=problem.substeps, threads=problem.threads
    )


def _steps(x: Array, u: Array) -> Iterator[Array]:
    """Yield (K, n) answers to a step of one unit, from 0, for (N, n) states and (N, 1) input."""
    volts = u[:, 0]
    size = float(np.ptp(volts))
    if u.shape[1] > 1 or size == 0.0:
        return
    edges = np.flatnonzero(np.abs(np.diff(volts)) > _QUIET * size) + 1
    bounds = [0, *edges.tolist(), len(volts)]
    for first, at, last in zip(bounds[:-2], bounds[1:-1], bounds[2:], strict=True):
        before, after = volts[first:at], volts[at:last]
        if min(before.size, after.size) < _SHORTEST:
            continue
        change = float(after.mean() - before.mean())
        start, end = x[first:at][-before.size // 3 :], x[at:last]
        speed = end[:, -1] - start[:, -1].mean()
        if abs(change) > _JUMP * size and _is_settled(start[:, -1], speed) and _is_settled(
            speed[-after.size // 3 :], speed
        ):  # fmt: skip
            yield (end - start.mean(axis=0)) / change


def _is_settled(tail: Array, whole: Array) -> bool:
    """Whether the mean of a tail is the same in both of its halves."""
    half = tail.size // 2
    drift = abs(float(tail[half:].mean() - tail[:half].mean()))
    return drift < _SETTLED * abs(float(whole[-whole.size // 3 :].mean()))


def points(answer: Array, dt: float, *, peaked: Sequence[int] | None = None) -> Array:
    """Return the characteristic points of (K, n) states that answer a unit step.

    Final value of each state; time of 63 % of the last one, the speed; peak and time of the peak
    of each that overshoots, or of the states `peaked`.
    """
    final = answer[-answer.shape[0] // 3 :].mean(axis=0)
    found = [*final, _reached(answer[:, -1] / final[-1], dt)]
    for k in range(answer.shape[1] - 1) if peaked is None else peaked:
        top = float(np.max(answer[:, k]))
        if peaked is not None or top > _OVERSHOOT * final[k]:
            found += _peak(answer[:, k], dt)
    return np.asarray(np.maximum(np.array(found), 1e-12))


def _reached(part: Array, dt: float) -> float:
    """Return when a value first passes 63 %, between two samples."""
    at = int(np.argmax(part > _RISE))
    if at == 0:
        return 0.5 * dt
    after, climb = float(part[at]), float(part[at] - part[at - 1])
    return dt * (at - (after - _RISE) / max(climb, 1e-12))


def _peak(values: Array, dt: float) -> tuple[float, float]:
    """Return height and time of the highest point, by the parabola through its neighbours."""
    at = int(np.clip(np.argmax(values), 1, values.size - 2))
    left, top, right = values[at - 1 : at + 2]
    bend = left - 2 * top + right
    shift = float(np.clip(0.5 * (left - right) / bend, -1, 1)) if bend < 0 else 0.0
    return float(top - 0.25 * (left - right) * shift), max(dt * (at + shift), 0.25 * dt)


def _matched(problem: Problem, core: Core, steps: Sequence[Array], dt: float) -> Model:
    """Return the model whose step response has the points of the steps."""
    least = min(len(points(step, dt)) for step in steps)
    peaked = range((least - len(core.states) - 1) // 2)
    read = np.median([points(step, dt, peaked=peaked) for step in steps], axis=0)
    longest = max(len(step) for step in steps)
    free = [p for p in problem.free if p.lower > 0]
    start = np.log([p.value for p in free])
    low = np.maximum(np.log([p.lower for p in free]), start - _REACH)
    high = np.minimum(np.log([p.upper for p in free]), start + _REACH)

    def with_logs(z: Array) -> Model:
        values = {p.name: float(np.exp(v)) for p, v in zip(free, z, strict=True)}
        return problem.model.with_values(values)

    def off(z: Array) -> Array:
        phi, gamma = core.step(with_logs(z).parameters.values(), dt)
        drive = np.repeat(gamma[np.newaxis, :, :1], longest, axis=0)
        answer = response(phi, drive)[:, :, 0]
        return np.asarray(np.log(points(answer, dt, peaked=peaked) / read))

    found = least_squares(off, start, bounds=(low, high), diff_step=[1e-3] * len(free))
    return with_logs(found.x)
