"""Positions that start anew at the end of their sensor's range; and those that do not."""

from pathlib import Path

import numpy as np
import pytest
from recording_tools import joints, motor_record, MS, START, vector, write_bag

from motor_sysid.errors import UserError
from motor_sysid.recording import load, Loaded
from motor_sysid.signals import Finding, Record
from motor_sysid.signals.doctor import examine
from motor_sysid.signals.wrapping import find_wrap, unwrapped

TURN = 2 * np.pi
GOOD = motor_record(6000)
TRUE = GOOD['position'] - GOOD['position'][0]
CONFIG = 'time: {column: t}\nsignals:\n  position: {column: x, '


def wrapped(period: float, begin: float = 0.0, position: np.ndarray = TRUE) -> np.ndarray:
    """Return a position as a sensor of that range shows it, from `begin` on."""
    return (position - begin) % period + begin


def read(folder: Path, values: np.ndarray, unit: str = 'rad', style: str = '%.9g') -> Loaded:
    """Return a record of times, voltage and those positions, read from a CSV."""
    path = folder / 'a.csv'
    rows = zip(GOOD.time, GOOD['voltage'], values, strict=False)
    lines = [f'{t:.6g},{u:.6g},{style % x}' for t, u, x in rows]
    path.write_text('\n'.join([f'time [s],voltage [V],position [{unit}]', *lines]))
    return load(path)


def configured(folder: Path, values: np.ndarray, source: str) -> Loaded:
    """Return a record read through a msg_config file."""
    rows = [f'{0.001 * k:.3f},{x:.9g}' for k, x in enumerate(values)]
    (folder / 'b.csv').write_text('\n'.join(['t,x', *rows]))
    (folder / 'b.yaml').write_text(CONFIG + source + '}')
    return load(folder / 'b.csv', folder / 'b.yaml')


def jumps(record: Record) -> list[Finding]:
    return [f for f in examine(record) if f.code == 'position_jumps']


@pytest.mark.parametrize(
    ('unit', 'period', 'begin'),
    [('rad', 25.0, -12.5), ('rad', 10 * TURN, 0.0), ('deg', 7200.0, -3600.0), ('turns', 2.0, 0.0),
     ('rad', np.pi, 0.0), ('rad', 25.6, -12.8)],
)  # fmt: skip
def test_a_range_that_is_no_turn_is_found_and_told(
    tmp_path: Path, unit: str, period: float, begin: float
) -> None:
    size = {'rad': 1.0, 'deg': np.pi / 180, 'turns': TURN}[unit]
    loaded = read(tmp_path, wrapped(period, begin, TRUE / size), unit)
    position = loaded.records[0]['position']
    assert position - position[0] == pytest.approx(TRUE, abs=1e-6)
    (said,) = loaded.findings
    assert (said.code, said.severity) == ('position_unwrapped', 'info')
    assert f'starts anew every {period:.9g} {unit}' in said.message
    assert said.numbers['period_rad'] == pytest.approx(period * size)
    assert not jumps(loaded.records[0])


def test_a_counter_that_overflows_is_made_continuous(tmp_path: Path) -> None:
    counts = np.floor(20 * TRUE / TURN * 4096) % 65536 - 32768
    loaded = configured(tmp_path, counts, 'unit: counts, counts_per_turn: 4096, gear_ratio: 10')
    position = loaded.records[0]['position']
    assert position - position[0] == pytest.approx(2 * TRUE, abs=TURN / 4096)
    assert 'every 65536 counts' in loaded.findings[0].message


def test_a_range_is_found_in_a_bag(tmp_path: Path) -> None:
    stamps = [START + k * MS for k in range(len(GOOD))]
    angles = [
        (s, joints(s, ['a'], [x], [])) for s, x in zip(stamps, wrapped(25.0), strict=True)
    ]  # fmt: skip
    volts = [(s, vector(s, u)) for s, u in zip(stamps, GOOD['voltage'], strict=True)]
    topics = {
        'motor/speed': ('sensor_msgs/msg/JointState', angles),
        'motor/voltage': ('geometry_msgs/msg/Vector3Stamped', volts),
    }
    loaded = load(write_bag(tmp_path / 'bag', topics))
    assert loaded.records[0]['position'] == pytest.approx(TRUE, abs=1e-6)
    assert 'position_unwrapped' in {finding.code for finding in loaded.findings}


@pytest.mark.parametrize(
    ('unit', 'begin', 'style', 'odd', 'close'),
    [
        ('rad', -np.pi, '%.1f', None, 0.06),
        ('deg', 0.0, '%.6f', 361.0, 1e-6),
        ('deg', 0.0, '%.6f', 1000.0, 1e-6),
        ('deg', -180.0, '%.0f', 90.0, 0.01),
    ],
)
def test_rounding_or_an_outlier_costs_no_turn(
    tmp_path: Path, unit: str, begin: float, style: str, odd: float | None, close: float
) -> None:
    size = {'rad': 1.0, 'deg': np.pi / 180}[unit]
    for k in (3000, 3004, 3009):
        values = wrapped(TURN / size, begin, TRUE / size)
        others = np.arange(values.size) != k
        if odd is not None:
            values[k] = odd
        position = read(tmp_path, values, unit, style).records[0]['position']
        off = (position - position[0] - TRUE)[others]
        assert np.max(np.abs(off)) < 2 * close


def test_a_range_that_rounding_makes_larger_than_a_turn_is_one(tmp_path: Path) -> None:
    true = np.sort(np.append(np.linspace(0, 9, 3000), [np.pi - 1e-5, np.pi + 1e-5]))
    loaded = read(tmp_path, wrapped(TURN, -np.pi, true), style='%.3f')  # from -3.142 to 3.142
    assert loaded.records[0]['position'] == pytest.approx(true, abs=2e-3)


def servo(seed: int, overshoot: bool) -> np.ndarray:
    """Return how a servo goes between the ends of its range, logged ten times while it does."""
    rng = np.random.default_rng(seed)
    target = np.repeat(rng.choice([-3.0, 3.0], 60), 12)
    angle, speed, shown = 0.0, 0.0, []
    for goal in target:
        for _ in range(20):
            speed += 0.05 * ((goal - angle) * 30 - speed * (5 if overshoot else 11))
            angle += 0.05 * speed
        shown.append(angle)
    return np.array(shown)


def hole() -> np.ndarray:
    return np.delete(TRUE, slice(2000, 2600))


def set_to_zero() -> np.ndarray:
    return np.where(np.arange(6000) < 3000, TRUE, TRUE - TRUE[3000])


GENUINE = {
    'continuous': TRUE,
    'coarse': np.floor(TRUE / TURN * 6) / 6 * TURN,
    'two counts at rest': 0.3 * (np.arange(500) // 7 % 2),
    'servo': servo(0, False),
    'servo that overshoots': servo(1, True),
    'ends of the range': np.repeat(np.random.default_rng(0).choice([0.0, 300.0], 80), 9) / 57.3,
    'fast oscillation': 20 * np.sin(2.5 * np.arange(800)),
    'noise': np.random.default_rng(0).standard_normal(800),
    'fast return': np.tile(np.append(np.linspace(0, 10, 40), [6.0, 2.0]), 30),
    'hole': hole(),
    'set to zero': set_to_zero(),
    'outlier': np.where(np.arange(6000) == 3000, 400.0, TRUE),
    'at rest': np.zeros(100),
}


@pytest.mark.parametrize('case', GENUINE)
def test_what_moves_like_that_is_left_alone(tmp_path: Path, case: str) -> None:
    loaded = configured(tmp_path, GENUINE[case], 'unit: rad')
    assert loaded.records[0]['position'] == pytest.approx(GENUINE[case], rel=1e-8, abs=1e-8)
    assert loaded.findings == ()


def test_a_reference_that_jumps_is_left_alone(tmp_path: Path) -> None:
    saw = np.tile(np.linspace(-12.5, 12.5, 100), 20)
    for values in (saw, np.repeat(np.tile([0.0, 5.5], 20), 50)):
        rows = [f'{0.001 * k:.3f},1,{x:.9g}' for k, x in enumerate(values)]
        path = tmp_path / 'a.csv'
        path.write_text('\n'.join(['time [s],voltage [V],position_reference [rad]', *rows]))
        assert load(path).records[0]['position_reference'] == pytest.approx(values, abs=1e-7)


def few(count: int) -> np.ndarray:
    """Return a position that turns one way and passes the end of its range so often."""
    return wrapped(25.0, position=np.linspace(1.0, 25.0 * count + 1, 400 * count))


def test_a_jump_or_two_are_told_with_the_range_but_not_mended(tmp_path: Path) -> None:
    loaded = configured(tmp_path, few(2), 'unit: rad')
    assert loaded.records[0]['position'] == pytest.approx(few(2))
    (said,) = jumps(loaded.records[0])
    assert said.severity == 'warning'
    assert said.message.startswith('position jumps 2 times, by up to 24.94 rad, first from 24.9')
    assert 'to start anew every 25 rad' in said.message
    assert '`wrap: 25`' in said.remedy
    mended = configured(tmp_path, few(2), 'unit: rad, wrap: 25').records[0]
    assert np.diff(mended['position']) == pytest.approx(50.0 / 799, rel=1e-5)
    assert not jumps(mended)


def test_no_wrap_is_mended_where_the_file_says_so(tmp_path: Path) -> None:
    for period in (25.0, TURN):
        values = wrapped(period)
        loaded = configured(tmp_path, values, 'unit: rad, wrap: 0')
        assert loaded.records[0]['position'] == pytest.approx(values, rel=1e-8)
        assert loaded.findings == ()
    degrees = np.degrees(few(2))
    source = f'unit: deg, wrap: {np.degrees(25):.9g}, gear_ratio: 5'
    position = configured(tmp_path, degrees, source).records[0]['position']
    assert np.diff(position) == pytest.approx(10.0 / 799, rel=1e-5)


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('signals: {position: {column: x, wrap: -1}}', r'`wrap` is -1.0, must be 0 \(never\) or'),
        ('signals: {speed: {column: x, wrap: 7}}', 'goes with position and position_reference'),
        ('signals: {position: {column: x, wrap: often}}', '`signals.position.wrap` must be a num'),
    ],
)
def test_ranges_that_are_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / 'a.csv').write_text('t,x\n0,1\n1,2\n')
    (tmp_path / 'a.yaml').write_text('time: {column: t}\n' + text)
    with pytest.raises(UserError, match=message):
        load(tmp_path / 'a.csv', tmp_path / 'a.yaml')


def test_the_speed_tells_what_is_a_jump_and_what_is_none() -> None:
    def spoilt(position: np.ndarray) -> Record:
        return GOOD.with_signal('position', position, 'rad')

    (said,) = jumps(spoilt(wrapped(25.0)))
    assert 'to start anew every 25 rad' in said.message
    (said,) = jumps(spoilt(set_to_zero()))
    assert said.message.startswith('position jumps once')
    assert said.remedy.startswith('look for a sensor that was reset')
    (said,) = jumps(spoilt(np.where(np.arange(6000) == 700, TRUE + 9, TRUE)))
    assert said.numbers['jumps'] == 2
    assert not jumps(GOOD)
    assert not jumps(spoilt(GENUINE['coarse']))
    assert not jumps(spoilt(TRUE * 180 / np.pi))  # that is a unit, and told as such


def test_an_outlier_is_told_without_a_speed() -> None:
    for values, count in ((TRUE, 0), (np.where(np.arange(6000) == 700, TRUE + 9, TRUE), 1)):
        record = GOOD.select(['voltage']).with_signal('position', values, 'rad')
        assert len(jumps(record)) == count


def test_little_is_no_evidence() -> None:
    assert find_wrap(np.array([6.0, np.nan, 0.1])) is None
    assert find_wrap(np.full(5, np.nan)) is None
    assert unwrapped(np.array([np.nan, 3.0, np.nan]), TURN)[1] == 3.0
    wrap = find_wrap(np.array([350.0, 10.0, np.nan, 30.0]) * np.pi / 180)
    assert wrap is not None
    assert (wrap.period, wrap.places.tolist()) == (TURN, [0])
