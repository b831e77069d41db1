"""Which sources of noise make a spectrum: those that are there, and seldom one more."""

import numpy as np
import pytest

from motor_sysid.diagnosis.calibration.mixture import parsimonious

MEMORIES = (0.0, 3.0, 10.0, 30.0, 100.0, 300.0)
BANDS = np.geomspace(2e-3, 0.5, 25)
COUNTS = 0.5 * np.round(np.diff(np.geomspace(2e-3, 0.55, 26)) * 2000 + 1)
DRAWS = 400
FORCES = 6
"""Place of the first force among the sources."""


def sources() -> np.ndarray:
    """Return (b, k) spectra at two sensors: errors of each, and forces that reach both."""
    turn = (2 * np.pi * BANDS) ** 2
    shapes = [np.ones_like(BANDS) if m == 0.0 else 2 * m / (1 + m**2 * turn) for m in MEMORIES]
    none = np.zeros_like(BANDS)
    current = [np.stack((one, none), axis=1) for one in shapes[:3]]
    speed = [np.stack((none, one), axis=1) for one in shapes[:3]]
    force = [np.stack((one * turn / (0.01 + turn), one / (0.001 + turn)), 1) for one in shapes]
    return np.column_stack([one.ravel() for one in current + speed + force])


def found(rng: np.random.Generator, factors: np.ndarray) -> tuple[int, ...]:
    """Return which sources are found in the mean periodogram of a drawn record."""
    power, weights = sources(), np.repeat(COUNTS, 2)
    true = power @ factors
    seen = true * rng.gamma(weights, 1.0 / weights)
    kept = parsimonious(seen, np.zeros_like(seen), power, weights)
    return tuple(int(k) for k in np.flatnonzero(kept))


def test_seldom_a_source_that_is_not_there():
    """The best of ten others has to be more than chance makes it: at most 1 % have one too many.

    A true 1 % has more than 11 of 400 once in 1000.
    """
    rng = np.random.default_rng(4)
    factors = np.zeros(12)
    factors[[0, 3]] = 1.0, 3.0
    wrong = sum(found(rng, factors) != (0, 3) for _ in range(DRAWS))
    assert wrong <= 11, wrong


@pytest.mark.parametrize(('size', 'told'), [(3.8e-4, False), (7e-4, True)])
def test_the_best_of_many_pays_for_having_been_chosen(size: float, told: bool) -> None:
    """The smaller force lowers the deviance by 10.4: the plain BIC asks for 7.0.

    That there are twelve to choose from asks for another 5.0; the larger one lowers it by 25.6.
    """
    factors = np.zeros(12)
    factors[[0, 3, 8]] = 1.0, 3.0, size
    power = sources()
    seen = power @ factors
    kept = parsimonious(seen, np.zeros_like(seen), power, np.repeat(COUNTS, 2))
    assert bool(np.any(kept[FORCES:])) is told


def test_a_force_that_is_there_is_found():
    """With this memory or one beside it, of which a short record knows little."""
    rng = np.random.default_rng(5)
    factors = np.zeros(12)
    factors[[0, 3, 8]] = 1.0, 3.0, 0.1
    assert all(max(found(rng, factors)) >= FORCES for _ in range(40))


def test_what_is_known_may_be_all_there_is() -> None:
    """Rounding alone, say: then no source is added, and none is looked for among no others."""
    power = sources()
    seen = np.full(len(power), 2.0)
    assert not np.any(parsimonious(seen, seen, power, np.repeat(COUNTS, 2)))
    assert parsimonious(seen, seen, power[:, :0], np.repeat(COUNTS, 2)).shape == (0,)
