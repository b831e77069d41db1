"""Stray samples are found, told and mended; what a motor does is none."""

import numpy as np
import pytest
from recording_tools import motor_record

from motor_sysid.benchmark.cases import draw
from motor_sysid.benchmark.scenarios import named_case
from motor_sysid.diagnosis import diagnose
from motor_sysid.diagnosis.where.uneven_records import but_for_few
from motor_sysid.signals import Record
from motor_sysid.signals.doctor import examine
from motor_sysid.signals.strays import stray_places, strays_of, told_strays, without_strays

RECORD = motor_record(6000)
TIME = RECORD.time


def spoilt(record: Record, name: str, changes: dict[int, float]) -> Record:
    values = record[name].copy()
    for place, change in changes.items():
        values[place] += change
    return record.with_signal(name, values, record.units[name])


def counted(speed: np.ndarray, counts: int = 1000) -> np.ndarray:
    """Return a speed as differences of encoder counts give it."""
    step = 2 * np.pi / counts
    at = np.floor(np.cumsum(speed) * 1e-3 / step) * step
    return np.diff(at, prepend=at[0]) / 1e-3


MOVES = {
    'triangles with sharp turns': 50 * np.abs((TIME * 4) % 2 - 1),
    'steps of acceleration after rest': np.maximum(np.sin(3 * TIME), 0.0) * 100,
    'jumps': np.repeat(np.arange(60) % 2, 100) * 10.0,
    'a slow creep in counts': counted(np.full(6000, 1.3)),
    'short moves in counts after long rest': counted(40.0 * (np.sin(2 * np.pi * TIME) > 0.95)),
    'rest': np.zeros(6000),
    'one step': (TIME > 3) * 5.0,
    'noise': np.random.default_rng(1).standard_normal(6000),
    'noise with wide tails': np.random.default_rng(2).laplace(size=6000),
}


@pytest.mark.parametrize('name', MOVES)
def test_what_moves_is_no_stray(name: str) -> None:
    assert stray_places(MOVES[name]).size == 0


def test_a_good_record_has_none_and_stays_itself() -> None:
    assert list(strays_of(RECORD)) == []
    assert without_strays(RECORD) is RECORD


@pytest.mark.parametrize(
    'changes',
    [
        {700: 300.0},
        {700: -300.0, 1800: 250.0, 4000: 900.0},
        {700: 300.0, 701: -300.0},
        {700: 1e6},
        {700: 300.0, 1500: 1e5},
    ],
)
def test_planted_ones_are_found_and_mended(changes: dict[int, float]) -> None:
    """Alone, or two in a row as a position that is off makes of its difference; of any size."""
    bad = spoilt(RECORD, 'speed', changes)
    found = list(strays_of(bad))
    assert [(f.name, *f.places) for f in found] == [('speed', *changes)]
    mended = without_strays(bad)
    usual = np.max(np.abs(np.diff(RECORD['speed'])))
    assert np.max(np.abs(mended['speed'] - RECORD['speed'])) < usual
    assert np.array_equal(np.delete(mended['speed'], [*changes]),
                          np.delete(RECORD['speed'], [*changes]))  # fmt: skip
    assert mended.provenance.notes[-1].startswith(f'{len(changes)} sample')


@pytest.mark.parametrize('place', [0, 1, 2, 5997, 5998, 5999])
@pytest.mark.parametrize('change', [300.0, -1e4])
def test_at_the_ends(place: int, change: float) -> None:
    """A difference that begins with nothing before it, or a message that was cut off."""
    moving = RECORD.slice(20, 6000)
    bad = spoilt(moving, 'speed', {place if place < 100 else place - 20: change})
    (found,) = strays_of(bad)
    assert [*found.places] == [place if place < 100 else place - 20]
    usual = 2 * np.max(np.abs(np.diff(moving['speed'])))
    assert np.max(np.abs(without_strays(bad)['speed'] - moving['speed'])) < usual


@pytest.mark.parametrize('samples', [1, 3, 10])
def test_a_start_from_rest_is_none(samples: int) -> None:
    """However few samples the motor takes to be fast."""
    rng = np.random.default_rng(5)
    count, fade = 2000, np.exp(-3.0 / samples)
    voltage = np.repeat(rng.uniform(-12, 12, count // 40), 40)
    voltage[:40] = 12.0
    speed = np.zeros(count)
    for k in range(count - 1):
        dry = 0.02 * np.sign(speed[k])
        speed[k + 1] = fade * speed[k] + (1 - fade) * 20 * (voltage[k] - dry)
    speed += 0.01 * rng.standard_normal(count)
    time = 1e-3 * np.arange(count)
    record = Record(time, {'voltage': voltage, 'speed': speed},
                    {'voltage': 'V', 'speed': 'rad/s'})  # fmt: skip
    assert list(strays_of(record)) == []


def test_a_current_that_begins_at_rest_under_a_voltage_is_none() -> None:
    """It is the first sample of a step that was switched on with the recording."""
    moving = RECORD.slice(20, 6000)
    bad = spoilt(moving, 'current', {0: 40.0})
    for first, places in ((0.0, [0]), (np.max(moving['voltage']), [])):
        volts = np.where(np.arange(len(moving)) < 10, first, moving['voltage'])
        told = strays_of(bad.with_signal('voltage', volts, 'V'))
        assert [int(k) for one in told for k in one.places] == places


def test_what_is_not_finite_is_left_to_others() -> None:
    assert stray_places(np.where(RECORD['speed'] == RECORD['speed'][50], np.inf, 1.0)).size == 0


def test_those_of_many_are_found() -> None:
    """Up to one in 125: their neighbours, whose line they bend, do not count."""
    places = np.sort(np.random.default_rng(0).choice(np.arange(5, 740), 48, replace=False)) * 8
    for name in ('speed', 'current', 'position'):
        bad = spoilt(RECORD, name, dict.fromkeys(places.tolist(), 1e4))
        assert np.array_equal(stray_places(bad[name]), places)


def test_many_are_none() -> None:
    """A tenth of all samples far off is what the signal is like."""
    places = np.arange(50, 5950, 10)
    assert stray_places(spoilt(RECORD, 'speed', dict.fromkeys(places, 300.0))['speed']).size == 0


def test_what_an_input_may_have_moved_is_left_alone() -> None:
    """A current that rises and falls within a sample of a voltage step may be real."""
    step = int(np.argmax(np.abs(np.diff(RECORD['voltage'])))) + 1
    assert len(list(strays_of(spoilt(RECORD, 'current', {step + 25: 40.0})))) == 1
    assert list(strays_of(spoilt(RECORD, 'current', {step + 1: 40.0}))) == []


def test_so_is_what_a_commutation_may_have_moved() -> None:
    """A phase that drives for some samples between two edges of Hall sectors."""
    step = int(np.argmax(np.abs(np.diff(RECORD['voltage'])))) + 1
    bad = spoilt(RECORD, 'current', {step + 25: 40.0})
    for edge, count in ((step + 24, 0), (step + 19, 1)):
        sectors = np.where(np.arange(len(RECORD)) < edge, 6.0, 1.0)
        assert len(list(strays_of(bad.with_signal('hall_sector', sectors, '1')))) == count


def test_the_doctor_and_a_fit_tell_them() -> None:
    bad = spoilt(RECORD, 'speed', {700: 300.0})
    findings = {f.code: f for f in examine(bad)}
    assert '1 sample of speed, at 0.7 s, is 300' in findings['stray_samples'].message
    (said,) = told_strays([RECORD, bad])
    assert said.startswith('a record: 1 sample of speed')


def test_one_of_a_position_counts_as_its_jump() -> None:
    codes = {f.code for f in examine(spoilt(RECORD, 'position', {700: 40.0}))}
    assert 'position_jumps' in codes
    assert 'stray_samples' not in codes


def test_no_glitch_hides_what_is_missing() -> None:
    """One sample of 33,000, as far off as the speed is large, hid a cogging torque of 10 %."""
    scenario, number = named_case('single/cogging_torque/10/0')
    case = draw(scenario, 9600, number)
    first, *others = case.train
    size = float(np.sqrt(np.mean(first['speed'] ** 2)))
    bad = spoilt(first, 'speed', {len(first) // 2: size})
    found = diagnose([bad, *others], case.valid, motor='brushed_dc')
    assert found.effects == ('cogging_torque',)
    assert any('1 sample of speed' in line for line in found.warnings)


def test_few_samples_make_no_error() -> None:
    """A thousandth of the samples does not count; more of them do."""
    rng = np.random.default_rng(4)
    noise = rng.standard_normal((10_000, 2))
    few, more = noise.copy(), noise.copy()
    few[::1001, 0] += 300.0
    more[::100, 1] += 300.0
    assert but_for_few(few) == pytest.approx(np.ones(2), abs=0.03)
    assert but_for_few(more)[1] > 25.0
    assert but_for_few(noise[:500]) == pytest.approx(np.sqrt(np.mean(noise[:500] ** 2, axis=0)))
