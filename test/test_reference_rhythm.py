"""A load that comes at the rhythm of the reference may be an effect of the motion."""

import numpy as np
import pytest

from motor_sysid.diagnosis.candidates.reference_rhythm import Rhythms
from motor_sysid.signals.record import Record

DT, PERIOD = 0.005, 3.1


def record(reference: np.ndarray) -> Record:
    t = DT * np.arange(reference.size)
    return Record(t, {'speed_reference': reference}, {'speed_reference': 'rad/s'})


def back_and_forth() -> np.ndarray:
    t = DT * np.arange(6000)
    return np.where((t % PERIOD) < PERIOD / 2, 1.0, -1.0) * (1 + 0.02 * t)


@pytest.mark.parametrize('waves', [1, 2, 3, 4])
def test_harmonics_of_the_motion_are_its_rhythm(waves):
    assert Rhythms([record(back_and_forth())]).has(waves / PERIOD)


@pytest.mark.parametrize('frequency', [0.43, 2.1, 6.0, 23.1])
def test_other_frequencies_are_not(frequency):
    assert not Rhythms([record(back_and_forth())]).has(frequency)


def test_a_random_reference_has_no_rhythm():
    """By chance one line in 1e15 stands out as far; 200 are looked at."""
    levels = np.repeat(np.random.default_rng(5).uniform(-1, 1, 60), 100)
    rhythms = Rhythms([record(levels)])
    assert not any(rhythms.has(f) for f in np.linspace(0.2, 20, 200))


def test_without_a_reference_nothing_is_left_out():
    t = DT * np.arange(1000)
    record = Record(t, {'voltage': np.sin(9 * t)}, {'voltage': 'V'})
    assert not Rhythms([record]).has(9 / (2 * np.pi))


def test_a_rhythm_that_one_reference_has_alone_is_not_that_of_the_motion():
    moved = record(back_and_forth())
    still = moved.select([name for name in moved if 'reference' not in name])
    assert Rhythms([moved, moved]).has(2 / PERIOD)
    assert not Rhythms([moved, still]).has(2 / PERIOD)
