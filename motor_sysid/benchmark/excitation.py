"""What the motor is made to do: voltage profiles, or speed references for a PI controller.

Every profile is a function of ``(time, slow, rng)`` that returns (N,) values between -1 and 1;
`slow` is the slowest time constant of the motor in s.  It begins with half a second of zero.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Profile = Callable[[Array, float, np.random.Generator], Array]

REST = 0.5
"""Zero command at the start, s."""


def random_steps(time: Array, slow: float, rng: np.random.Generator) -> Array:
    """Make steps of random height at random times."""
    return _held(time, slow, lambda: float(rng.uniform(-1, 1)), rng)


def two_levels(time: Array, slow: float, rng: np.random.Generator) -> Array:
    """Switch between two values at random times."""
    high, low = rng.uniform(0.6, 1.0), rng.uniform(-0.8, 0.3)
    state = [True]

    def level() -> float:
        state[0] = not state[0]
        return float(high if state[0] else low)

    return _held(time, slow, level, rng)


def triangles(time: Array, slow: float, rng: np.random.Generator) -> Array:
    """Slow triangular sweeps through zero."""
    phase = np.maximum(time - REST, 0.0) / rng.uniform(3.0, 8.0)
    wave: Array = 2 / np.pi * np.arcsin(np.sin(2 * np.pi * phase))
    return wave


def multisine(time: Array, slow: float, rng: np.random.Generator) -> Array:
    """Sum of sinusoids up to about the corner frequency of the motor."""
    corner = min(1 / (2 * np.pi * slow), 0.1 / float(time[1] - time[0]))
    frequencies = np.geomspace(0.1, 2 * corner, int(rng.integers(5, 10)))
    frequencies = frequencies * rng.uniform(0.85, 1.15, frequencies.size)
    phases = rng.uniform(0, 2 * np.pi, frequencies.size)
    weights = frequencies**-0.3
    waves = np.sin(2 * np.pi * np.outer(time - REST, frequencies) + phases) @ weights
    fade = np.clip((time - REST) / 0.2, 0, 1)
    scaled: Array = fade * waves / np.max(np.abs(waves))
    return scaled


def chirp(time: Array, slow: float, rng: np.random.Generator) -> Array:
    """Sinusoid of rising frequency."""
    t = np.maximum(time - REST, 0.0)
    first, last = 0.1, min(3 / (2 * np.pi * slow), 20.0)
    rate = np.log(last / first) / t[-1]
    wave: Array = np.sin(2 * np.pi * first * (np.exp(rate * t) - 1) / rate)
    return wave


def staircase(time: Array, slow: float, rng: np.random.Generator) -> Array:
    """Up and down a staircase in both directions."""
    count, hold = int(rng.integers(3, 6)), float(rng.uniform(0.3, 0.8))
    up = np.arange(1, count + 1) / count
    levels = np.concatenate([up, up[-2::-1], [0.0], -up, -up[-2::-1], [0.0]])
    index = np.floor(np.maximum(time - REST, 0.0) / hold).astype(int)
    values: Array = np.where(time < REST, 0.0, levels[index % levels.size])
    return values


PROFILES: dict[str, Profile] = {
    'random steps': random_steps,
    'two levels': two_levels,
    'triangles': triangles,
    'multisine': multisine,
    'chirp': chirp,
    'staircase': staircase,
}


def _held(
    time: Array, slow: float, level: Callable[[], float], rng: np.random.Generator
) -> Array:
    values, now = np.zeros_like(time), REST
    longest = float(np.clip(12 * slow, 0.2, 1.5))
    while now < time[-1]:
        values[time >= now] = level()
        now += rng.uniform(0.15, 1.0) * longest
    return values
