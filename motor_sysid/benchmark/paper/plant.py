"""The plant of the paper as a model: ``b e^(-tau s) / (a2 s^2 + a1 s + a0)``, sampled exactly.

The input is held between samples.  With ``tau = d h + delta`` an interval sees the input of d + 1
samples before for its first part delta and that of d samples before for the rest; both parts are
steps, whose responses are known in closed form.  No Pade approximation, no rounding of the delay.
(Astrom and Wittenmark 1997, Computer-Controlled Systems, section 2.3.)
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.paper.control import DT, Loop, pid
from motor_sysid.machine_code import kept

Array = NDArray[np.float64]

TRUE = np.array([5.0, 3.0, 1.0, 5.0, 1.0])
"""a0, a1, a2, b, and tau in s; a0 is B R + K_t K_e (B R + K_t R, as printed, would be 12)."""

NAMES = ('a0', 'a1', 'a2', 'b', 'tau')
SEEN = ('a0/a2', 'a1/a2', 'b/a2', 'tau')
"""What records hold; a2 is a free scale."""


def simulate(candidates: Array, reference: Array, loop: Loop) -> Array:
    """Return the outputs (P, N) of (P, 5) candidates.

    Parameters
    ----------
    candidates:
        (P, 5) in the order of `NAMES`, all positive.
    reference:
        (N,) input of the plant, in a closed loop the reference.
    loop:
        Where the input comes from.
    """
    outputs = np.empty((len(candidates), reference.size))
    with np.errstate(all='ignore'):
        for row, one in zip(outputs, np.ascontiguousarray(candidates), strict=True):
            _respond(one, reference, loop.gains, loop.closed, loop.inside, row)
    return outputs


def seen(candidate: Array) -> Array:
    """Return a0/a2, a1/a2, b/a2 and tau of a candidate (5,)."""
    a0, a1, a2, b, tau = candidate
    return np.array([a0 / a2, a1 / a2, b / a2, tau])


def whole(four: Array) -> Array:
    """Return the candidates (..., 5) with a2 = 1 of (..., 4) numbers as `seen` gives them."""
    ones = np.ones(four.shape[:-1])
    return np.stack([four[..., 0], four[..., 1], ones, four[..., 2], four[..., 3]], axis=-1)


@kept(error_model='numpy')
def _waves(a0, a1, a2, t):  # type: ignore[no-untyped-def]
    """Return ``e^(-s t) cosh w t`` and ``e^(-s t) sinh(w t) / w``; -s +- w are the poles."""
    s = 0.5 * a1 / a2
    square = s * s - a0 / a2
    if abs(square) * t * t < 1e-12:
        fade = np.exp(-s * t)
        return fade, fade * t
    if square > 0:
        w = np.sqrt(square)
        slow, fast = np.exp((w - s) * t), np.exp(-(w + s) * t)
        return 0.5 * (slow + fast), 0.5 * (slow - fast) / w
    w, fade = np.sqrt(-square), np.exp(-s * t)
    return fade * np.cos(w * t), fade * np.sin(w * t) / w


@kept(error_model='numpy')
def _advanced(x, v, u, p, t):  # type: ignore[no-untyped-def]
    """Return output and its rate after the time t with the input u held."""
    a0, a1, a2, b, _ = p
    c, s = _waves(a0, a1, a2, t)
    half = 0.5 * a1 / a2
    rest = x - b * u / a0
    return (
        b * u / a0 + (c + half * s) * rest + s * v,
        -(a0 / a2) * s * rest + (c - half * s) * v,
    )


@kept(error_model='numpy')
def _matrix(p, t):  # type: ignore[no-untyped-def]
    """Return (2, 3): output and rate after the time t by output, rate and held input."""
    found, unit = np.empty((2, 3)), np.eye(3)
    for k in range(3):
        found[0, k], found[1, k] = _advanced(unit[k, 0], unit[k, 1], unit[k, 2], p, t)
    return found


@kept(error_model='numpy')
def _respond(p, reference, gains, closed, inside, y):  # type: ignore[no-untyped-def]
    """Fill the output y (N,) of one plant."""
    count = reference.size
    late = int(np.floor(p[4] / DT))
    part = p[4] - late * DT
    step, first, second = _matrix(p, DT), _matrix(p, part), _matrix(p, DT - part)
    u, memory = np.zeros(count), np.zeros(3)
    x = v = 0.0
    xs, vs = np.zeros(count), np.zeros(count)
    for k in range(count):
        xs[k], vs[k] = x, v
        if closed and not inside:
            j = max(k - late - 1, 0)
            was = second[0, 0] * xs[j] + second[0, 1] * vs[j] + second[0, 2] * u[j]
            y[k] = was if k > late else 0.0
            u[k] = pid(reference[k] - x, gains, memory)
            x, v = _moved(step, x, v, u[k])
            continue
        y[k] = x
        u[k] = pid(reference[k] - x, gains, memory) if closed else reference[k]
        x, v = _moved(first, x, v, u[k - late - 1] if k > late else 0.0)
        x, v = _moved(second, x, v, u[k - late] if k >= late else 0.0)


@kept(error_model='numpy')
def _moved(matrix, x, v, u):  # type: ignore[no-untyped-def]
    """Return output and rate after one interval."""
    return (
        matrix[0, 0] * x + matrix[0, 1] * v + matrix[0, 2] * u,
        matrix[1, 0] * x + matrix[1, 1] * v + matrix[1, 2] * u,
    )
