"""The readings of the paper's experiment, and records with noise: what there is to be fitted."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.paper import truth
from motor_sysid.benchmark.paper.control import DT, Loop
from motor_sysid.benchmark.paper.plant import simulate, TRUE

Array = NDArray[np.float64]

OPEN = Loop()
OUTSIDE = Loop(8.0, 5.0, 2.0, inside=False)
PRINTED = Loop(8.0, 5.0, 2.0)
CALM = Loop(0.8, 0.5, 0.2)

NOISE = (40, 30, 20)
"""Ratios of signal to noise power, dB."""

CLOCK = 0.5
"""Shortest time between two changes of the binary input, s."""


@dataclass(frozen=True)
class Study:
    """Something to be fitted.

    Attributes
    ----------
    drive:
        (N,) what the model is given: the input, or in a closed loop the reference.
    loop:
        The loop that the model runs in.
    measured:
        (N,) output, noise included.
    plant:
        (5,) the truth.
    sigma:
        Standard deviation of the noise.
    """

    drive: Array
    loop: Loop
    measured: Array
    plant: Array
    sigma: float = 0.0

    @property
    def time(self) -> Array:
        """(N,) s."""
        return np.linspace(0.0, DT * (self.drive.size - 1), self.drive.size)

    def simulate(self, candidates: Array) -> Array:
        """Return outputs (P, N) of (P, 5) candidates."""
        return simulate(candidates, self.drive, self.loop)

    def errors(self, candidates: Array) -> Array:
        """Return measured minus simulated, (P, N)."""
        return self.measured - self.simulate(candidates)


@dataclass(frozen=True)
class Reading:
    """One way to read the paper's set-up: noise-free, unit step, ITAE over the horizon."""

    title: str
    loop: Loop
    horizon: float

    def study(self) -> Study:
        """Return it with the output of the true plant."""
        reference = np.ones(round(self.horizon / DT))
        clean = _clean(tuple(TRUE.tolist()), reference.tobytes(), self.loop)[1]
        return Study(reference, self.loop, clean, TRUE)


READINGS: Mapping[str, Reading] = {
    'R1': Reading('R1: open loop, 10 s', OPEN, 10.0),
    'R2': Reading('R2: closed loop around the output before the delay, 10 s', OUTSIDE, 10.0),
    'R3': Reading('R3: closed loop with the delay inside, gains a tenth of the printed, 20 s',
                  CALM, 20.0),
}  # fmt: skip
"""The paper's closed loop with its gains and the delay inside is unstable; see `stability`."""


def levels(values: tuple[float, ...], hold: float) -> Array:
    """Return an input that holds each value for `hold` seconds."""
    return np.repeat(np.array(values), round(hold / DT))


def binary(rng: np.random.Generator, seconds: float) -> Array:
    """Return a random binary input of -1 and 1."""
    steps = round(seconds / CLOCK)
    return np.repeat(2.0 * rng.integers(0, 2, steps) - 1.0, round(CLOCK / DT))


RECORDS: Mapping[str, str] = {
    'D1': 'D1: open loop, unit step, 10 s',
    'D2': 'D2: open loop, five levels, 40 s',
    'D3': 'D3: closed loop with the delay inside, gains a tenth, five levels, 40 s',
    'D4': 'D4: open loop, random binary, 40 s',
}
"""Records at 100 Hz with noise on the output."""

STEPS = levels((1.0, 0.5, 1.5, -0.5, 1.0), 8.0)
UNSEEN = levels((1.0, -1.0, 0.3, 1.4, -0.6, 0.8), 5.0)
"""Inputs of training and of validation."""


def record(key: str, decibel: int | None, seed: int, plant: Array = TRUE) -> Study:
    """Return a record of the true plant with noise.

    Parameters
    ----------
    key:
        Of `RECORDS`.
    decibel:
        Ratio of the mean square of the output to the variance of the noise, dB; None for none.
    seed:
        Of the noise, and of the binary input.
    plant:
        (5,) the truth.
    """
    rng = np.random.default_rng([seed, int(key[1]), decibel or 0])
    loop = CALM if key == 'D3' else OPEN
    reference = np.ones(round(10.0 / DT)) if key == 'D1' else STEPS
    if key == 'D4':
        reference = binary(rng, 40.0)
    u, clean = _clean(tuple(plant.tolist()), reference.tobytes(), loop)
    sigma = 0.0 if decibel is None else float(np.sqrt(np.mean(clean**2))) * 10 ** (-decibel / 20)
    noise = sigma * rng.standard_normal(reference.size)
    y = clean + noise
    if loop.closed:
        u, y = truth.run(plant, reference, loop, noise)
    return Study(u, OPEN, y, plant, sigma)


def unseen(plant: Array = TRUE) -> Study:
    """Return the validation record, without noise."""
    u, y = _clean(tuple(plant.tolist()), UNSEEN.tobytes(), OPEN)
    return Study(u, OPEN, y, plant)


@lru_cache(maxsize=64)
def _clean(plant: tuple[float, ...], reference: bytes, loop: Loop) -> tuple[Array, Array]:
    """Return input and output without noise; the same ones are asked for over and over."""
    return truth.run(np.array(plant), np.frombuffer(reference), loop)
