"""A line in what is left is told from noise and random loads."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from motor_sysid.diagnosis.verdict.words import complete
from motor_sysid.diagnosis.where.oscillation import Swing, swing_of
from motor_sysid.diagnosis.where.remainder import Remainder

DT = 1e-3


def chain(count):
    return [SimpleNamespace(scored=True, drive=SimpleNamespace(dt=DT), residual=count)]


def found(train, held):
    parts = [SimpleNamespace(residuals=(np.column_stack([r, 0 * r]),)) for r in (train, held)]
    return swing_of(*parts, ([chain(len(train))], [chain(len(held))]))


def noise(rng, count, memory=0.0):
    return lfilter([1.0], [1.0, -memory], rng.normal(size=count))


def sine(count, frequency, phase=0.0):
    return np.sin(2 * np.pi * frequency * DT * np.arange(count) + phase)


@pytest.mark.parametrize('memory', [0.0, 0.9, 0.999])
def test_noise_and_random_loads_do_not_swing(memory):
    """A false line is rarer than 1e-60 by theory; 200 draws show that nothing was overlooked."""
    rng = np.random.default_rng(3)
    for _ in range(200):
        assert found(noise(rng, 8000, memory), noise(rng, 3000, memory)) is None


def test_a_swing_of_any_phase_is_found_with_frequency_and_share():
    rng = np.random.default_rng(4)
    swing = found(
        noise(rng, 8000) + sine(8000, 7.3), noise(rng, 3000, 0.0) + sine(3000, 7.3, 2.0)
    )
    assert swing.frequency == pytest.approx(7.3, abs=0.1)
    assert swing.share == pytest.approx(1 / 3, rel=0.15)  # a power of 1/2 beside a noise of 1


def test_a_swing_must_be_the_same_in_all_data():
    rng = np.random.default_rng(5)
    one = noise(rng, 8000) + sine(8000, 7.3)
    assert found(one, noise(rng, 3000)) is None
    assert found(one, noise(rng, 3000) + sine(3000, 12.0)) is None
    assert found(one[:100], one[:100]) is None, 'too short'


def test_a_swing_is_missing_physics_if_it_is_no_trifle():
    def left(share, error):
        return Remainder({}, 1.0, error, error, 0.0, Swing(7.3, share))

    assert left(0.5, 4.0).structured
    assert left(0.5, 4.0).swings
    assert not left(0.05, 4.0).structured
    assert not left(0.2, 2.0).structured


def test_a_swing_that_is_a_trifle_in_the_held_out_data_counts_where_training_data_show_it():
    def left(training):
        swing = Swing(2.8, 0.9)
        return Remainder({}, 0.2, 0.7, 3.5, 0.0, swing, training_percent=training)

    assert left(4.0).structured
    assert not left(0.8).structured


@pytest.mark.parametrize(('noise', 'told'), [(25.0, True), (2.0, False)])
def test_noise_that_is_much_for_sensors_is_told(noise, told):
    """Play at 5 ms a sample passes for noise: nothing in the record tells the two apart."""
    left = Remainder({}, noise, noise, 1.0, 0.0)
    words = ' '.join(complete(SimpleNamespace(validation_error_percent=noise), left, []))
    assert ('much for sensors' in words) is told
