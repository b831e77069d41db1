"""Functions for writing laws of effects: branch-free, smooth, for numbers and arrays alike.

They compile into vectorized loops (libm calls would not) and give the same values when called
from plain Python with numbers or arrays.
"""

from collections.abc import Callable, Sequence
from typing import ParamSpec

from numba.extending import register_jitable
import numpy as np

P = ParamSpec('P')


def law_function(function: Callable[P, float]) -> Callable[P, float]:
    """Let laws call a function both compiled and from plain Python."""
    compiled: Callable[P, float] = register_jitable(forceinline=True)(function)
    return compiled

TWO_PI = 6.283185307179586
PI = 3.141592653589793
HALF_PI = 1.5707963267948966
THIRD = 2.0943951023931953
"""A third of a turn: what lies between two phases, rad."""


@law_function
def sqrt(x: float) -> float:
    """Square root of `x`."""
    return np.sqrt(x)  # type: ignore[no-any-return]


@law_function
def triangle(x: float) -> float:
    """Triangular wave (rad): `x` near 0, folded into ``[-pi/2, pi/2]`` with the period 2 pi."""
    turns = x * (1.0 / TWO_PI)
    r = turns - np.floor(turns + 0.5)
    folded = 0.25 - np.abs(np.abs(r) - 0.25)
    return TWO_PI * folded * np.sign(r)  # type: ignore[no-any-return]


@law_function
def trapezoid(x: float, flat: float, corner: float) -> float:
    """Trapezoidal wave of `x` (rad) between -1 and 1, zero and rising at 0.

    Each top is `flat` rad wide between its corners; each of them is a parabola that begins
    `corner` before and ends `corner` behind it, in units of what leads from zero to the top.
    """
    y = triangle(x) / (0.5 * (PI - flat))
    size = np.minimum(np.abs(y), 1.0 + corner)
    bent = np.maximum(size - 1.0 + corner, 0.0)
    return np.sign(y) * (size - bent * bent / (4.0 * corner))  # type: ignore[no-any-return]


@law_function
def sin(x: float) -> float:
    """Sine of `x` (rad), absolute error below 1e-11 for ``|x|`` up to 1e5.

    The argument is folded into ``[-pi/2, pi/2]`` and a Taylor polynomial of degree 17 is taken.
    """
    y = triangle(x)
    z = y * y
    p = 1.0 / 355687428096000.0
    p = p * z - 1.0 / 1307674368000.0
    p = p * z + 1.0 / 6227020800.0
    p = p * z - 1.0 / 39916800.0
    p = p * z + 1.0 / 362880.0
    p = p * z - 1.0 / 5040.0
    p = p * z + 1.0 / 120.0
    p = p * z - 1.0 / 6.0
    return y + y * z * p


@law_function
def cos(x: float) -> float:
    """Cosine of `x` (rad)."""
    return sin(x + HALF_PI)


@law_function
def smooth_sign(x: float, width: float) -> float:
    """Sign of `x` with a cubic smoothstep between ``-width`` and ``width``."""
    s = np.minimum(np.maximum(x / width, -1.0), 1.0)
    return s * (1.5 - 0.5 * s * s)  # type: ignore[no-any-return]


@law_function
def bell(x: float, width: float) -> float:
    """Lorentzian bell ``1 / (1 + (x / width)^2)``."""
    s = x / width
    return 1.0 / (1.0 + s * s)


@law_function
def clip(x: float, lower: float, upper: float) -> float:
    """`x` limited to ``[lower, upper]``."""
    return np.minimum(np.maximum(x, lower), upper)  # type: ignore[no-any-return]


@law_function
def smooth_step(x: float, width: float) -> float:
    """From 0 to 1 between ``-width`` and ``width``."""
    return 0.5 + 0.5 * smooth_sign(x, width)


@law_function
def settling(t: float, tau: float) -> float:
    """Time `t` that comes to an end: ``tau (1 - exp(-t / tau))``, `t` itself where `tau` is long.

    The exponential is that of a 256th, by a Taylor polynomial of degree 9, squared eight times;
    relative error below 1e-11 of the end value, without a branch.
    """
    y = clip(t / tau, 0.0, 40.0) * (1.0 / 256.0)
    p = 1.0
    for k in (9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0):
        p = 1.0 - y / k * p
    gone = y * p  # 1 - exp(-y), to the last digit
    for _ in range(8):
        gone = gone * (2.0 - gone)
    return tau * gone


@law_function
def step_share(turn: float) -> float:
    """Weight of a wave over the rotor angle of which one step covers `turn` rad.

    The mean force of such a wave over a step is ``sin(x) / x`` times that in its middle, with x
    half of `turn`; the mean of both ends, which a step takes, is ``cos(x)`` times that.  The
    weight makes up for the difference where the wave is resolved, and fades where a step covers
    half a wave or more: there the ends say nothing, and the true force averages out.
    """
    z = 0.25 * turn * turn
    fades = z * (1.0 / 2.56)
    fades = fades * fades
    return (1.0 + z / 3.0) / (1.0 + fades * fades)


@law_function
def atan(x: float) -> float:
    """Arc tangent of `x` in rad, absolute error below 1e-11, without a branch.

    The argument is folded into ``[0, 1]`` and halved in angle twice, where a Taylor polynomial of
    degree 17 is taken.
    """
    size = np.abs(x)
    small = np.minimum(size, 1.0) / np.maximum(size, 1.0)
    once = small / (1.0 + np.sqrt(1.0 + small * small))
    twice = once / (1.0 + np.sqrt(1.0 + once * once))
    z = twice * twice
    p = 1.0 / 17.0
    for k in (15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0):
        p = 1.0 / k - z * p
    angle = 4.0 * twice * (1.0 - z * p)
    past = 0.5 * (1.0 + np.sign(size - 1.0))
    return np.sign(x) * (angle + past * (HALF_PI - 2.0 * angle))  # type: ignore[no-any-return]


@law_function
def third_phase(x: float, y: float) -> float:
    """Return the current of the third phase where the star point floats."""
    return -x - y


@law_function
def amplitude(a: float, b: float) -> float:
    """Return the amplitude of three currents of sum zero, two of which are given."""
    return np.sqrt((4.0 / 3.0) * (a * a + a * b + b * b))  # type: ignore[no-any-return]


KNOTS = (0.0, 0.01, 0.04, 0.1, 0.18, 0.26, 0.34, 0.42, 0.52, 0.64, 0.76, 0.88, 1.0)
"""Where the values of a `table` lie on either side of zero, as shares of its range there.

They are dense near zero, where friction bends.
"""


@law_function
def table(
    x: float, back: float, ahead: float, fade: float, minus: Sequence[float],
    plus: Sequence[float],
) -> float:  # fmt: skip
    """Straight lines between values at `KNOTS`, on the side of `plus` up to `ahead`, else `back`.

    Beyond, the outermost value is held, and fades to zero over the distance `fade`.
    """
    seen = clip(x, -back, ahead)
    right, left = seen / ahead, -seen / back
    total = plus[0]
    for k in range(12):
        start, width = KNOTS[k], KNOTS[k + 1] - KNOTS[k]
        total = total + (plus[k + 1] - plus[k]) * clip((right - start) / width, 0.0, 1.0)
        total = total + (minus[k + 1] - minus[k]) * clip((left - start) / width, 0.0, 1.0)
    return total * np.maximum(1.0 - np.abs(x - seen) / fade, 0.0)  # type: ignore[no-any-return]
