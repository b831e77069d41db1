"""How much noise the sensors make at least."""

import numpy as np
import pytest

from motor_sysid.signals.lattice import lattice
from motor_sysid.signals.noise import fast_part, noise_sigmas, rounding_sigmas
from motor_sysid.signals.record import Record


def test_a_coarse_signal_that_is_held_has_the_noise_of_its_rounding():
    """Its neighbours are equal, so little fast noise shows; rounding is there all the same."""
    time = 1e-3 * np.arange(4000)
    speed = 40 * np.sin(3 * time) + 20 * np.sin(11 * time)
    held = np.repeat(np.round(speed[::5] / 3.2) * 3.2, 5)[: time.size, np.newaxis]
    assert noise_sigmas([held], [False]) < 0.6
    record = Record(time, {'speed': held[:, 0]}, {'speed': 'rad/s'})
    assert rounding_sigmas([record], ['speed']) == pytest.approx(3.2 / np.sqrt(12))
    assert np.std(held[::5, 0] - speed[::5]) == pytest.approx(3.2 / np.sqrt(12), rel=0.1)


def test_a_signal_that_takes_any_value_is_not_rounded():
    smooth = np.sin(np.linspace(0, 9, 500))
    steps = np.round(smooth, 1)
    units = {'speed': 'rad/s', 'position': 'rad'}
    both = Record(1e-3 * np.arange(500), {'speed': smooth, 'position': steps}, units)
    halves = both.slice(0, 200), both.slice(200, 500)
    found = rounding_sigmas(halves, ['speed', 'position'])
    assert found == pytest.approx([0.0, 0.1 / np.sqrt(12)])


def test_a_signal_that_was_interpolated_keeps_the_step_of_its_sensor():
    """Stamps in whole milliseconds of a loop of 1.4 ms: in between lie fractions of a count."""
    time = np.round(1.4e-3 * np.arange(600), 3)
    count = np.round(20 * np.sin(9 * time)) * np.pi / 180
    record = Record(time, {'position': count}, {'position': 'rad'}).uniform(1e-3)
    assert rounding_sigmas([record], ['position']) == pytest.approx(np.pi / 180 / np.sqrt(12))
    assert record.slice(0, 100).step_of('position') == pytest.approx(np.pi / 180)
    again = record.with_signal('position', 3.3 * record['position'], 'rad')
    assert again.step_of('position') != pytest.approx(np.pi / 180), 'another signal'


@pytest.mark.parametrize('digits', [4, 5, 6, 9])
def test_counts_that_are_written_with_few_digits_are_counts(digits):
    rng, step = np.random.default_rng(0), 2 * np.pi / 64
    counts = np.floor(np.cumsum(rng.normal(0, 0.05, 4000)) / step) * step
    written = np.round(counts, digits)
    for values in (written, np.diff(written)):
        found = lattice(values)
        assert found is not None
        assert found.step == pytest.approx(step, rel=2e-3)


def test_large_gaps_between_few_levels_are_no_step():
    """A signal in steps of 0.1 that goes far away and comes back."""
    rng = np.random.default_rng(0)
    near = np.round(np.cumsum(rng.normal(0, 0.05, 4000)), 1)
    assert lattice(np.where(rng.random(4000) < 0.3, 100 * near, near)).step == pytest.approx(0.1)


def test_what_is_fast_is_as_large_as_the_noise_that_makes_it():
    """Also where that grows with the signal, which a low quantile of blocks does not show."""
    white = np.random.default_rng(4).normal(size=20_001)
    swing = 5.0 * np.sin(np.arange(20_000) / 50)
    assert np.std(fast_part(swing)) < 1e-3
    assert np.std(fast_part(swing + white[1:])) == pytest.approx(1.0, rel=0.03)
    late = fast_part(swing + np.diff(white), differenced=True)
    assert np.std(late) == pytest.approx(np.sqrt(2), rel=0.03)
    grows = swing * (1 + 0.1 * white[1:])
    assert np.std(fast_part(grows)) == pytest.approx(0.1 * np.std(swing), rel=0.05)
    assert noise_sigmas([grows[:, np.newaxis]], [False])[0] < 0.8 * 0.1 * np.std(swing)
    assert fast_part(np.arange(5.0)).size == 5
