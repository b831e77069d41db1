"""What acts in one record only shows there, though nothing predicts it."""

import numpy as np
import pytest

from motor_sysid.diagnosis.compare import Comparison
from motor_sysid.diagnosis.uneven import UNEVEN, unevenness_of

SIZE = 20.0


class Stretch:
    """A scored stretch of data."""

    scored = True


def comparison(*sizes: float, count: int = 4000) -> Comparison:
    """Two outputs with noise of 1; the first has as much more as it is told, in each record."""
    rng = np.random.default_rng(3)
    residuals = tuple(rng.normal(0, [s, 1.0], (count, 2)) for s in sizes)
    measured = tuple(np.full((count, 2), SIZE) for _ in sizes)
    return Comparison(5.0, {}, (), residuals, measured)


def chains(count: int) -> list[tuple[Stretch, ...]]:
    """One stretch for each record."""
    return [(Stretch(),)] * count


@pytest.mark.parametrize(
    ('sizes', 'expected'), [((1, 1, 1), 1.0), ((1, 3, 1), 3.0), ((1, 1, 5), 5.0)]
)
def test_the_worst_record_counts(sizes, expected):
    """In training or held back; noise alone is even."""
    *train, held = sizes
    found = unevenness_of(comparison(*train), comparison(held), (chains(2), chains(1)), np.ones(2))
    assert found.ratio == pytest.approx(expected, rel=0.1)
    assert found.percent == pytest.approx(100 * np.sqrt(expected**2 - 1) / SIZE, abs=1.5)


def test_less_than_sensor_noise_is_no_measure():
    """An encoder at rest has no error at all, which makes no other record a bad one."""
    found = unevenness_of(comparison(1e-6, 1), comparison(1), (chains(2), chains(1)), np.ones(2))
    assert found.ratio < UNEVEN / 1.5


def test_a_record_in_pieces_counts_as_one():
    """Pieces of one record are taken together: what happens once in it is no other record."""
    pieces = comparison(1, 1, 1, 9)
    one = [(Stretch(),) * 4]
    found = unevenness_of(pieces, comparison(4.5), (one, chains(1)), np.ones(2))
    assert found.ratio < 1.2
