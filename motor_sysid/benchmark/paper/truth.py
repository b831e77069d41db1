"""The plant of the paper simulated the hard way, with nothing of `plant`.

Classical Runge-Kutta steps of a hundredth of a sample; the delay is a look back at the input, as a
mean over the step where an edge falls into it.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.paper.control import DT, Loop, pid
from motor_sysid.machine_code import kept

Array = NDArray[np.float64]

STEPS = 100
"""Integration steps in a sample."""


def run(
    plant: Array, reference: Array, loop: Loop, noise: Array | None = None
) -> tuple[Array, Array]:
    """Return input and measured output, (N,) each.

    Parameters
    ----------
    plant:
        (5,) a0, a1, a2, b, tau.
    reference:
        (N,) input, in a closed loop reference.
    loop:
        Where the input comes from.
    noise:
        (N,) noise of the sensor, which a loop around the measured output feeds back.
    """
    extra = np.zeros(reference.size) if noise is None else noise
    y, u = np.zeros(reference.size), np.zeros(reference.size)
    _run(plant, reference, loop.gains, loop.closed, loop.inside, extra, y, u)
    return u, y


@kept(error_model='numpy')
def _run(p, reference, gains, closed, inside, noise, y, u):  # type: ignore[no-untyped-def]
    count, h = reference.size, DT / STEPS
    fine = np.zeros(count * STEPS + 1)
    memory, x, v = np.zeros(3), 0.0, 0.0
    outside = closed and not inside
    for k in range(count):
        y[k] = (_before(fine, k * STEPS - p[4] / h) if outside else x) + noise[k]
        if closed:
            u[k] = pid(reference[k] - (x if outside else y[k]), gains, memory)
        else:
            u[k] = reference[k]
        for j in range(STEPS):
            now = u[k] if outside else _held(u, k, k + (j + 0.5) / STEPS - p[4] / DT)
            x, v = _step(p, x, v, now, h)
            fine[k * STEPS + j + 1] = x


@kept(error_model='numpy')
def _before(fine, place):  # type: ignore[no-untyped-def]
    """Output at a place between two steps, 0 before the start."""
    if place <= 0:
        return 0.0
    low = int(np.floor(place + 1e-9))
    part = max(place - low, 0.0)
    return fine[low] + part * (fine[min(low + 1, fine.size - 1)] - fine[low])


@kept(error_model='numpy')
def _held(u, newest, middle):  # type: ignore[no-untyped-def]
    """Mean input over a step around the sample `middle`."""
    last = int(np.floor(middle + 0.5 / STEPS - 1e-9))
    first = int(np.floor(middle - 0.5 / STEPS + 1e-9))
    now = u[min(last, newest)] if last >= 0 else 0.0
    if first == last:
        return now
    old = u[first] if first >= 0 else 0.0
    part = (middle + 0.5 / STEPS - last) * STEPS
    return part * now + (1.0 - part) * old


@kept(error_model='numpy')
def _rate(p, x, v, u):  # type: ignore[no-untyped-def]
    return (p[3] * u - p[1] * v - p[0] * x) / p[2]


@kept(error_model='numpy')
def _step(p, x, v, u, h):  # type: ignore[no-untyped-def]
    """One classical Runge-Kutta step."""
    f1 = _rate(p, x, v, u)
    v2 = v + 0.5 * h * f1
    f2 = _rate(p, x + 0.5 * h * v, v2, u)
    v3 = v + 0.5 * h * f2
    f3 = _rate(p, x + 0.5 * h * v2, v3, u)
    v4 = v + h * f3
    f4 = _rate(p, x + h * v3, v4, u)
    return x + h / 6.0 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6.0 * (f1 + 2 * f2 + 2 * f3 + f4)
