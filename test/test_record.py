"""The record: what it refuses, and that its operations keep their promises."""

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from motor_sysid.errors import UserError
from motor_sysid.signals import Record
from motor_sysid.signals.record import resample, Samples

UNITS = {'voltage': 'V', 'speed': 'rad/s', 'hall_sector': '1'}


def make(count: int = 10, dt: float = 0.1) -> Record:
    time = dt * np.arange(count)
    return Record(time, {'voltage': np.floor(time), 'speed': np.sin(time)}, UNITS)


@pytest.mark.parametrize(
    ('time', 'values', 'message'),
    [
        ([0.0], [1.0], 'at least 2 samples'),
        ([0.0, 1.0], [1.0], '`speed` has 1 samples, time has 2'),
        ([0.0, 0.0], [1.0, 2.0], 'must strictly increase'),
        ([1.0, 0.5], [1.0, 2.0], r'1 s is followed by 0\.5 s at sample 1'),
        ([0.0, np.nan], [1.0, 2.0], 'must strictly increase'),
    ],
)
def test_refuses(time: list[float], values: list[float], message: str) -> None:
    with pytest.raises(UserError, match=message):
        Record(np.array(time), {'speed': np.array(values)}, UNITS)


def test_missing_unit_and_signal_are_named() -> None:
    with pytest.raises(UserError, match='`speed` has no unit'):
        Record(np.arange(3.0), {'speed': np.zeros(3)}, {})
    with pytest.raises(UserError, match='no signal `torque`; it has voltage, speed'):
        make()['torque']


def test_values_cannot_be_changed_from_outside() -> None:
    values = np.zeros(10)
    record = make().with_signal('speed', values, 'rad/s')
    values[:] = 1
    assert not record['speed'].any()
    with pytest.raises(ValueError, match='read-only'):
        record['speed'][0] = 1


def test_a_shift_takes_what_was_sampled_with_it() -> None:
    own = Samples(np.array([0.05, 0.55]), np.array([1.0, 2.0]))
    record = replace(make(), samples={'speed': own}, steps={'speed': 0.25, 'voltage': 1.0})
    moved = record.shifted('speed', -0.5)
    assert np.array_equal(moved['speed'], record['speed'] - 0.5)
    assert np.array_equal(moved['voltage'], record['voltage'])
    assert np.array_equal(moved.samples['speed'].values, [0.5, 1.5])
    assert np.array_equal(moved.samples['speed'].time, own.time)
    assert (moved.step_of('speed'), moved.step_of('voltage')) == (0.25, 1.0)
    assert moved.units == record.units


def test_digest_is_about_content_alone() -> None:
    record = make()
    assert record.digest() == record.select(['speed', 'voltage']).digest()
    other = record.with_signal('speed', record['speed'] + 1e-15, 'rad/s')
    assert record.digest() != other.digest()


@given(st.integers(2, 60), st.floats(0.05, 0.95))
def test_split_loses_nothing(count: int, fraction: float) -> None:
    record = make(max(count, 8) * 5)
    train, valid = record.split(fraction)
    assert np.array_equal(np.concatenate((train.time, valid.time)), record.time)


def test_segments_and_between() -> None:
    record = make(20)
    gapped = Record(np.delete(record.time, slice(8, 12)), {'speed': np.zeros(16)}, UNITS)
    assert [len(part) for part in gapped.segments(0.2)] == [8, 8]
    assert record.between(0.45, 1.0).time == pytest.approx([0.5, 0.6, 0.7, 0.8, 0.9])


def test_uniform_keeps_a_uniform_record() -> None:
    record = make()
    assert record.uniform() is record


@given(st.integers(0, 1000), st.floats(0.01, 0.5))
def test_resampled_input_keeps_its_integral(seed: int, dt: float) -> None:
    """Volt-seconds of a held input survive a change of the time axis."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.01, 0.1, 50))
    values = rng.uniform(-5, 5, 50)
    edges = np.arange(time[0], time[-1], dt)
    carried = resample('voltage', time, values, edges)
    fine = np.unique(np.append(time[time < edges[-1]], edges))
    held = values[np.searchsorted(time, fine[:-1], side='right') - 1]
    area = np.sum(carried * np.diff(edges))
    assert area == pytest.approx(np.sum(held * np.diff(fine)), abs=1e-9)


def test_what_is_carried_exactly() -> None:
    time = np.array([0.0, 1.0, 2.0])
    values = np.array([0.1, 0.2, 0.3])
    edges = np.array([0.0, 0.5, 1.0, 1.5, 2.0])
    assert resample('voltage', time, values, edges).tolist() == [0.1, 0.1, 0.2, 0.2]
    assert resample('hall_sector', time, values, edges).tolist() == [0.1, 0.1, 0.2, 0.2]
    assert resample('speed', time, values, edges) == pytest.approx([0.1, 0.15, 0.2, 0.25])
    assert resample('voltage', time, values, np.array([0.5, 1.5])) == pytest.approx([0.15])
    assert resample('hall_sector', time, values, np.array([0.5, 1.5])).tolist() == [0.1]
