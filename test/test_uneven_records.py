"""What acts in one record only shows there, though nothing predicts it."""

from dataclasses import replace

import numpy as np
import pytest

from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.diagnosis.where.remainder import Remainder
from motor_sysid.diagnosis.where.uneven_records import UNEVEN, unevenness_of
from motor_sysid.signals.record import Record

ONES, PLAIN = np.ones(2), (False, False)


class Stretch:
    """A scored stretch of data, under control or not."""

    scored = True

    def __init__(self, *, closed: bool = False):
        t = 1e-3 * np.arange(100)
        columns = {'voltage': 0 * t} | ({'speed_reference': np.sin(t)} if closed else {})
        units = {'voltage': 'V', 'speed_reference': 'rad/s'}
        self.record = Record(t, columns, {name: units[name] for name in columns})


def comparison(*sizes: float, count: int = 4000) -> Comparison:
    """Two outputs with noise of 1; the first has as much more as it is told, in each record."""
    rng = np.random.default_rng(3)
    residuals = tuple(rng.normal(0, [s, 1.0], (count, 2)) for s in sizes)
    measured = tuple(np.ones((count, 2)) for _ in sizes)
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
    held_back = comparison(held)
    found = unevenness_of(comparison(*train), held_back, (chains(2), chains(1)), ONES, PLAIN)
    assert found == pytest.approx(expected, rel=0.1)


def test_less_than_sensor_noise_is_no_measure():
    """An encoder at rest has no error at all, which makes no other record a bad one."""
    found = unevenness_of(comparison(1e-6, 1), comparison(1), (chains(2), chains(1)), ONES, PLAIN)
    assert found < 1.2


def test_records_under_control_are_compared_apart():
    """A controller lets random loads do less to the speed, in every record that it runs."""
    closed = [(Stretch(closed=True),)] * 2
    found = unevenness_of(comparison(1, 1), comparison(5), (closed, chains(1)), ONES, PLAIN)
    assert found < 1.2
    found = unevenness_of(comparison(1, 1), comparison(5, 1), (closed, chains(2)), ONES, PLAIN)
    assert found == pytest.approx(5.0, rel=0.1)


def test_a_record_in_pieces_counts_as_one():
    """Pieces of one record are taken together: what happens once in it is no other record."""
    pieces = comparison(1, 1, 1, 9)
    one = [(Stretch(),) * 4]
    found = unevenness_of(pieces, comparison(4.5), (one, chains(1)), ONES, PLAIN)
    assert found < 1.2


@pytest.mark.parametrize(
    ('unevenness', 'error', 'structured'), [(3.0, 5.0, True), (1.5, 5.0, False), (3.0, 0.9, False)]
)
def test_an_uneven_model_lacks_something_unless_it_is_a_trifle(unevenness, error, structured):
    """Nothing predicts it, and yet it is no noise; below 1 % of the signal no law is exact."""
    left = Remainder({'speed': 0.1}, 0.5, error, 4.0, 0.0, None, unevenness)
    assert left.structured is structured


@pytest.mark.parametrize('late', [True, False])
def test_counts_that_a_motion_is_in_step_with_make_no_record_an_uneven_one(late):
    """The difference errs by half a count at 3.5 counts a sample, and by less at 3.1."""
    rng = np.random.default_rng(5)
    counts = [rng.choice(3, (4000, 2), p=p) for p in ((0.5, 0.49, 0.01), (0.94, 0.05, 0.01))]
    parts = [Comparison(5.0, {}, (), (c - np.mean(c),), (c + 3.0,)) for c in counts]
    found = unevenness_of(*parts, (chains(1), chains(1)), np.full(2, 0.21), (late, late))
    sizes = [np.std(part.residuals[0], axis=0) for part in parts]
    assert np.all(sizes[0] > UNEVEN * sizes[1])
    assert found < 1.35


def test_a_record_may_have_more_fast_noise_but_not_more_of_all_else():
    """What is slow in the larger error, or is none of what was measured, is no sensor's."""
    small, large = comparison(1), comparison(4)
    noisy = replace(large, measured=large.residuals)
    slow = tuple(np.cumsum(r, axis=0) / 20 for r in large.residuals)
    drifting = replace(large, residuals=slow, measured=slow)
    for held, low, high in ((noisy, 1.0, 1.1), (large, 3.9, 4.1), (drifting, 3.0, 100.0)):
        found = unevenness_of(small, held, (chains(1), chains(1)), ONES, PLAIN)
        assert low <= found <= high
