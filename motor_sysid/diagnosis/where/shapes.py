"""Simple shapes that a function of one axis may have, and how people call them.

A shape is tried as one or a few columns beside the base parameters; those with a width, an order
or a moment are tried for several.  Amplitudes are in the unit of the force.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.where.axes import FAR

Array = NDArray[np.float64]

PROPORTION = 'grows in proportion'

WIDTHS = np.geomspace(0.004, 0.5, 12)
"""Widths of steps and bumps that are tried, as a share of the axis."""

ENDS = np.geomspace(0.004, 0.5, 40)
"""Ends of what stops at once that are tried, as a share of the axis: next to the right one of
them, 83 % of it are explained."""

MOMENTS = 120
"""Moments of a step in time that are tried."""

TOP_ORDER = 120
"""Most waves per turn that are tried."""

HIGHEST_SLOW, MOST_SLOW = 0.97, 2000
"""Most waves per turn of what repeats over many turns; and how many are tried."""

STANDS_OUT = 8.0
"""Height of a line of the spectrum over its neighbours."""


@dataclass(frozen=True)
class Shape:
    """A shape to try.

    Attributes
    ----------
    words:
        What it is called, with its widths in the unit of the axis.
    columns:
        (K,) values of the axis to (K, k) columns with amplitude 1.
    signed:
        Whether its sign means something against the direction of motion.
    choices:
        How many were tried of its kind.
    """

    words: str
    columns: Callable[[Array], Array]
    signed: bool = False
    choices: int = 1


def shapes_of(axis: str, unit: str, values: Array, target: Array) -> Iterator[Shape]:
    """Give the shapes to try on an axis with (K,) values, for (K,) forces."""
    reach = float(np.max(np.abs(values))) or 1.0
    if axis in ('speed', 'current', 'input'):
        yield from _around_zero(axis, unit, reach)
    elif axis == 'position' and unit == 'rad':
        yield from _waves(values, target)
    elif axis == FAR:
        yield from _over_turns(values, target)
    elif axis.startswith('time'):
        yield from _in_time(values, target)
    else:
        yield Shape(PROPORTION, lambda x: x[:, np.newaxis] / reach)


def _around_zero(axis: str, unit: str, reach: float) -> Iterator[Shape]:
    one = np.newaxis
    yield Shape('in proportion to it', lambda x: x[:, one] / reach, True)
    yield Shape('odd, grows with the square', lambda x: (x * np.abs(x))[:, one] / reach**2, True)
    yield Shape('even, grows with the square', lambda x: x[:, one] ** 2 / reach**2)
    yield Shape('odd, grows with the cube', lambda x: x[:, one] ** 3 / reach**3, True)
    yield Shape('even, grows with its size', lambda x: np.abs(x)[:, one] / reach)
    for width in ENDS * reach:
        yield Shape(f'odd, grows up to {_figure(width)} {unit} and is gone beyond',
                    _up_to(width), True, ENDS.size)  # fmt: skip
    for width in WIDTHS * reach:
        beyond = _figure(2 * width)
        yield Shape(f'odd, constant beyond {beyond} {unit}', _step(width), True, WIDTHS.size)
        yield Shape(f'odd, another constant for each sign beyond {beyond} {unit}',
                    _uneven_step(width), True, WIDTHS.size)  # fmt: skip
        gone = f'{_figure(3 * width)} {unit}'
        yield Shape(f'odd, largest at small {axis} and gone beyond {gone}', _peak(width), True,
                    WIDTHS.size)  # fmt: skip
        yield Shape(f'odd, highest at small {axis} and constant beyond {gone}',
                    _step_and_peak(width, reach), True, WIDTHS.size)  # fmt: skip
        yield Shape(f'even, a bump at zero {axis}, gone beyond {beyond} {unit}',
                    _bump(width), False, WIDTHS.size)  # fmt: skip


def _step(width: float) -> Callable[[Array], Array]:
    return lambda x: np.tanh(x / width)[:, np.newaxis]


def _uneven_step(width: float) -> Callable[[Array], Array]:
    return lambda x: np.stack([np.tanh(x / width), np.abs(np.tanh(x / width))], axis=1)


def _peak(width: float) -> Callable[[Array], Array]:
    return lambda x: (np.tanh(4 * x / width) * np.exp(-np.abs(x) / width))[:, np.newaxis]


def _step_and_peak(width: float, reach: float) -> Callable[[Array], Array]:
    step, peak = _step(WIDTHS[0] * reach), _peak(width)
    return lambda x: np.concatenate([step(x), peak(x)], axis=1)


def _up_to(width: float) -> Callable[[Array], Array]:
    return lambda x: np.where(np.abs(x) < width, x / width, 0.0)[:, np.newaxis]


def _bump(width: float) -> Callable[[Array], Array]:
    return lambda x: np.exp(-((x / width) ** 2))[:, np.newaxis]


def _waves(angle: Array, target: Array) -> Iterator[Shape]:
    orders = standing_orders(angle, target)
    for n in orders:
        words = 'once per turn' if n == 1 else f'{n} waves per turn'
        yield Shape(words, _wave(float(n)), False, TOP_ORDER)
    for n in orders[1:]:
        first = orders[0]
        yield Shape(f'{first} and {n} waves per turn', _two_waves(first, n), False, TOP_ORDER**2)


def standing_orders(angle: Array, target: Array, count: int = 3) -> list[int]:
    """Return the waves per turn that stand out of a force over (K,) rad, strongest first."""
    orders = np.arange(1, TOP_ORDER + 1)
    turn = np.exp(-1j * angle)
    wave, height = np.ones_like(turn), np.empty(orders.size)
    for k in range(orders.size):
        wave = wave * turn
        height[k] = np.abs(np.mean(wave * target)) ** 2
    near = [np.median(height[max(k - 12, 0) : k + 13]) for k in range(orders.size)]
    ratio = height / np.maximum(near, 1e-300)
    found = [k for k in np.argsort(-height).tolist() if ratio[k] > STANDS_OUT]
    return [int(orders[k]) for k in found[:count]]


def slow_orders(angle: Array, target: Array) -> list[float]:
    """Return the waves per turn, less than one, that stand out of a force over (K,) rad.

    The strongest, or none.  What turns behind a gear goes round once in many turns of the motor.
    """
    turns = float(np.ptp(angle)) / (2 * np.pi)
    orders = np.linspace(0.5 / turns, HIGHEST_SLOW, min(round(4 * turns), MOST_SLOW))
    wave, height = target * np.exp(-1j * orders[0] * angle), np.empty(orders.size)
    turn = np.exp(-1j * (orders[1] - orders[0]) * angle)
    for k in range(orders.size):
        height[k] = np.abs(np.mean(wave)) ** 2
        wave = wave * turn
    best = int(np.argmax(height))
    if height[best] <= STANDS_OUT * np.median(height):
        return []
    step = orders[1] - orders[0]
    near = np.linspace(max(orders[best] - step, 0.5 * orders[0]), orders[best] + step, 41)
    return [min(near.tolist(), key=lambda n: _left(_wave(n)(angle), target))]


def _left(columns: Array, target: Array) -> float:
    coefficients = np.linalg.lstsq(columns, target, rcond=None)[0]
    return float(np.sum((target - columns @ coefficients) ** 2))


def _over_turns(angle: Array, target: Array) -> Iterator[Shape]:
    middle, reach = 0.5 * float(angle.max() + angle.min()), 0.5 * float(np.ptp(angle)) or 1.0
    yield Shape(PROPORTION, lambda x: ((x - middle) / reach)[:, np.newaxis])
    for n in slow_orders(angle, target):
        yield Shape(f'once every {_figure(1 / n)} turns', _wave(n), False, MOST_SLOW)


def _wave(n: float) -> Callable[[Array], Array]:
    return lambda x: np.stack([np.sin(n * x), np.cos(n * x)], axis=1)


def _two_waves(first: int, second: int) -> Callable[[Array], Array]:
    return lambda x: np.concatenate([_wave(first)(x), _wave(second)(x)], axis=1)


def _in_time(clock: Array, target: Array) -> Iterator[Shape]:
    begin, end = float(clock.min()), float(clock.max())
    span = end - begin or 1.0
    yield Shape('drifts steadily', lambda x: ((x - begin) / span)[:, np.newaxis])
    for share in (0.05, 0.1, 0.2, 0.4):
        yield Shape(f'settles within {_figure(3 * share * span)} s',
                    _settling(begin, share * span), False, 4)  # fmt: skip
    for moment in np.linspace(begin, end, MOMENTS + 2)[1:-1]:
        yield Shape(f'steps at {_figure(float(moment))} s', _from(float(moment)), False, MOMENTS)
    for frequency in _frequencies(clock, target):
        yield Shape(f'a wave of {_figure(frequency)} Hz', _wave(2 * np.pi * frequency), False,
                    clock.size)  # fmt: skip


def _settling(begin: float, constant: float) -> Callable[[Array], Array]:
    return lambda x: (1 - np.exp(-(x - begin) / constant))[:, np.newaxis]


def _from(moment: float) -> Callable[[Array], Array]:
    return lambda x: (x >= moment).astype(np.float64)[:, np.newaxis]


def _frequencies(clock: Array, target: Array, count: int = 2) -> list[float]:
    """Return the frequencies in Hz that stand out, to a tenth of a line, strongest first."""
    step = float(np.median(np.diff(clock)))
    grid = np.arange(clock.min(), clock.max(), step)
    even = np.interp(grid, clock, target)
    power = np.abs(np.fft.rfft(even * np.hanning(even.size), 8 * even.size)) ** 2
    lines = np.fft.rfftfreq(8 * even.size, step)
    power[: 8 * 3] = 0.0
    found: list[float] = []
    background = float(np.median(power[8 * 3 :])) if power.size > 8 * 3 else np.inf
    for _ in range(count):
        k = int(np.argmax(power))
        if power[k] < 4 * STANDS_OUT * background:
            break
        found.append(float(lines[k]))
        power[max(k - 24, 0) : k + 25] = 0.0
    return found


def _figure(value: float) -> str:
    return f'{value:.2g}' if abs(value) < 100 else f'{value:.3g}'
