"""Functions for writing laws of effects: branch-free, smooth, for numbers and arrays alike.

They compile into vectorized loops (libm calls would not) and give the same values when called
from plain Python with numbers or arrays.
"""

from collections.abc import Callable
from typing import ParamSpec

from numba.extending import register_jitable
import numpy as np

P = ParamSpec('P')


def law_function(function: Callable[P, float]) -> Callable[P, float]:
    """Let laws call a function both compiled and from plain Python."""
    compiled: Callable[P, float] = register_jitable(function)
    return compiled

TWO_PI = 6.283185307179586
HALF_PI = 1.5707963267948966


@law_function
def sin(x: float) -> float:
    """Sine of `x` (rad), absolute error below 1e-11 for ``|x|`` up to 1e5.

    The argument is folded into ``[-pi/2, pi/2]`` and a Taylor polynomial of degree 17 is taken.
    """
    turns = x * (1.0 / TWO_PI)
    r = turns - np.floor(turns + 0.5)
    folded = 0.25 - np.abs(np.abs(r) - 0.25)
    y = TWO_PI * folded * np.sign(r)
    z = y * y
    p = 1.0 / 355687428096000.0
    p = p * z - 1.0 / 1307674368000.0
    p = p * z + 1.0 / 6227020800.0
    p = p * z - 1.0 / 39916800.0
    p = p * z + 1.0 / 362880.0
    p = p * z - 1.0 / 5040.0
    p = p * z + 1.0 / 120.0
    p = p * z - 1.0 / 6.0
    return y + y * z * p  # type: ignore[no-any-return]


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
def sqrt(x: float) -> float:
    """Square root of `x`."""
    return np.sqrt(x)  # type: ignore[no-any-return]


@law_function
def clip(x: float, lower: float, upper: float) -> float:
    """`x` limited to ``[lower, upper]``."""
    return np.minimum(np.maximum(x, lower), upper)  # type: ignore[no-any-return]


@law_function
def smooth_step(x: float, width: float) -> float:
    """From 0 to 1 between ``-width`` and ``width``."""
    return 0.5 + 0.5 * smooth_sign(x, width)


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
