"""Noise of a measured voltage is told by the current, which does not answer to it."""

from bench_motor import a_motor, measure, records, voltage_profile
import numpy as np
import pytest
from scipy.signal import savgol_filter

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.signals.doctor import examine, seen_by_fits
from motor_sysid.signals.noisy_input import (
    _in_windows,
    DEGREE,
    noisy_inputs_of,
    WINDOWS,
    with_quiet_inputs,
)
from motor_sysid.signals.record import Record

NOISE = 0.08


def noisy(record: Record, seed: int = 0) -> Record:
    """Return a record whose voltage was measured with noise, in steps of 20 mV."""
    volts = record['voltage'] + NOISE * np.random.default_rng(seed).normal(size=len(record))
    return record.with_signal('voltage', 0.02 * np.round(volts / 0.02), 'V')


def test_noise_that_does_not_act_is_told_and_taken_out():
    clean = records({})
    measured = [noisy(one, k) for k, one in enumerate(clean)]
    found = list(noisy_inputs_of(measured))
    assert [one.sigma for one in found] == pytest.approx([NOISE] * 3, rel=0.05)
    for quiet, true in zip(with_quiet_inputs(measured), clean, strict=True):
        assert np.std(quiet['voltage'] - true['voltage']) < 0.5 * NOISE
        assert np.max(np.abs(quiet['voltage'] - true['voltage'])) < 5 * NOISE
        assert 'smoothed between steps' in str(quiet.provenance)
    assert with_quiet_inputs(clean) == clean


@pytest.mark.parametrize('window', WINDOWS)
def test_all_pieces_at_once_are_smoothed_as_each_by_itself(window):
    rng = np.random.default_rng(1)
    values = np.cumsum(rng.normal(size=3000))
    ends = np.unique(rng.integers(1, 3000, size=90))
    pieces = np.split(np.arange(values.size), ends)
    sizes = {piece.size for piece in pieces}
    assert min(sizes) < 4
    assert max(sizes) > 105
    expected = values.copy()
    for piece in pieces:
        width = min(window, piece.size - 1 + piece.size % 2)
        if width > DEGREE + 1:
            expected[piece] = savgol_filter(values[piece], width, DEGREE)
    assert np.max(np.abs(_in_windows(values, pieces, window) - expected)) < 1e-9


def test_steps_stay_steps():
    clean = records({}, kinds=('steps',), seconds=4.0)
    (quiet,) = with_quiet_inputs([noisy(clean[0])])
    steps = np.abs(np.diff(clean[0]['voltage'])) > 2.0
    assert np.count_nonzero(steps) > 5
    assert np.abs(np.diff(quiet['voltage']))[steps] == pytest.approx(
        np.abs(np.diff(clean[0]['voltage']))[steps], abs=4 * NOISE
    )


@pytest.mark.parametrize('inductance', [2.4e-4, 2.4e-3, 2e-2])
def test_a_restless_voltage_that_acts_is_left_alone(inductance):
    """In one of the records, or in all: they have one sensor.  A slow winding answers slowly."""
    rng = np.random.default_rng(2)
    volts = voltage_profile('steps', 6.0, rng) + NOISE * rng.normal(size=6000)
    acts = measure(a_motor({}).with_values({'L': inductance}), volts, rng)
    assert not list(noisy_inputs_of([acts]))
    assert not list(noisy_inputs_of([acts, *map(noisy, records({}))]))


def test_without_steps_or_a_current_of_each_sample_nothing_is_told():
    smooth = noisy(records({}, kinds=('sines',))[0])
    assert not list(noisy_inputs_of([smooth]))
    stepped = noisy(records({}, kinds=('steps',))[0])
    last = np.arange(len(stepped)) // 10 * 10
    late = stepped.with_signal('current', stepped['current'][last], 'A')
    assert not list(noisy_inputs_of([late, late, late]))
    blind = Record(stepped.time, {'voltage': stepped['voltage']}, {'voltage': 'V'})
    assert not list(noisy_inputs_of([blind]))
    assert len(list(noisy_inputs_of([stepped, smooth]))) == 2


def test_the_doctor_and_the_diagnosis_say_so():
    measured = [noisy(one, k) for k, one in enumerate(records({}))]
    (finding,) = [one for one in examine(measured[:1]) if one.code == 'noisy_voltage']
    assert finding.numbers['noise_V'] == pytest.approx(NOISE, rel=0.05)
    assert 'smooths between steps' in ' '.join(seen_by_fits(measured))
    found = diagnose(measured[:2], measured[2:])
    assert found.verdict is Verdict.COMPLETE
