"""The data doctor: says what is wrong with spoilt data, and nothing about good data."""

from collections.abc import Callable
import json
from pathlib import Path
import re

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from recording_tools import motor_record

from motor_sysid.errors import UserError
from motor_sysid.recording import load
from motor_sysid.signals import Finding, Record
from motor_sysid.signals.checks.encoder import encoder_of
from motor_sysid.signals.checks.plausibility import slope_of, voltage_balance
from motor_sysid.signals.doctor import examine, require_usable

Spoil = Callable[[Record], Record]
RPM = 60 / (2 * np.pi)
DEG = 180 / np.pi


def found(record: Record | list[Record], k_e: float | None = None) -> dict[str, Finding]:
    return {f.code: f for f in examine(record, k_e) if f.severity != 'info'}


def scaled(name: str, factor: float) -> Spoil:
    return lambda r: r.with_signal(name, r[name] * factor, r.units[name])


def without(*names: str) -> Spoil:
    return lambda r: r.select([name for name in r if name not in names])


def delayed(name: str, samples: int) -> Spoil:
    def spoil(r: Record) -> Record:
        values = np.concatenate((np.full(samples, r[name][0]), r[name][:-samples]))
        return r.with_signal(name, values, r.units[name])

    return spoil


def replaced(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    return lambda r: r.with_signal(name, change(r[name].copy()), r.units[name])


def with_encoder(record: Record, counts: int = 2000) -> Record:
    """Return the record with position and speed as an encoder gives them."""
    lattice = 2 * np.pi / counts
    position = np.floor(record['position'] / lattice) * lattice
    speed = np.diff(position, prepend=position[0]) / record.dt
    return record.with_signal('position', position, 'rad').with_signal('speed', speed, 'rad/s')


GOOD = motor_record(6000)

def with_duty(spoil: Spoil) -> Spoil:
    return lambda r: spoil(r).with_signal('duty', r['voltage'] / 24, '1')


SPOILT: dict[str, tuple[str, str, Spoil]] = {
    'speed in rpm': ('speed_unit', 'error', scaled('speed', RPM)),
    'speed in deg/s': ('speed_unit', 'error', scaled('speed', DEG)),
    'speed in turns/s': ('speed_unit', 'error', scaled('speed', 1 / (2 * np.pi))),
    'position in degrees': ('position_unit', 'error', scaled('position', DEG)),
    'position in turns': ('position_unit', 'error', scaled('position', 1 / (2 * np.pi))),
    'gear between them': ('gear_ratio', 'error', scaled('position', 30)),
    'position backward': ('position_sign', 'error', scaled('position', -1)),
    'speed backward': ('speed_sign', 'error', scaled('speed', -1)),
    'current backward': ('current_sign', 'error', scaled('current', -1)),
    'other joint': (
        'position_speed_disagree', 'warning', replaced('position', lambda x: np.sin(x / 7) * 100)
    ),
    'voltage one row late': ('early_response', 'warning', delayed('voltage', 1)),
    'current 5 rows late': ('late_response', 'warning', delayed('current', 5)),
    'constant input': (
        'constant_input', 'error', replaced('voltage', lambda x: np.full(x.size, 3.0))
    ),
    'dead current sensor': (
        'stuck_channel', 'error', replaced('current', lambda x: np.full(x.size, 0.1))
    ),
    'frozen current': (
        'frozen_stretch', 'warning',
        replaced('current', lambda x: np.concatenate((x[:2000], np.full(800, x[2000]), x[2800:]))),
    ),
    'speed silent for 40 rows': (
        'frozen_stretch', 'warning',
        replaced('speed', lambda x: np.concatenate((x[:2010], np.full(40, x[2010]), x[2050:]))),
    ),
    'speed new in every fourth row': (
        'slow_updates', 'warning', replaced('speed', lambda x: np.repeat(x[::4], 4)[:x.size])
    ),
    'current new in every other row': (
        'slow_updates', 'warning', replaced('current', lambda x: np.repeat(x[::2], 2)[:x.size])
    ),
    'speed new at times of its own': (
        'slow_updates', 'warning',
        replaced('speed', lambda x: x[(np.floor(np.arange(x.size) / 5.4) * 5.4).astype(int)]),
    ),
    'voltage of the supply': (
        'voltage_of_supply', 'error',
        replaced('voltage', lambda x: 24.0 - 0.01 * np.abs(x)),
    ),
    'clipped current': ('saturation', 'warning', replaced('current', lambda x: np.clip(x, -2, 2))),
    'clipped current and a stray': (
        'saturation', 'warning',
        replaced('current', lambda x: np.where(x == x[777], 9.0, np.minimum(x, 2.0))),
    ),
    'coarse current': ('quantization', 'warning', replaced('current', np.round)),
    'one nan': (
        'non_finite', 'error', replaced('speed', lambda x: np.where(x == x[50], np.nan, x))
    ),
    'no input': ('no_input', 'error', without('voltage', 'current')),
    'duty cycle alone': ('no_input', 'error', with_duty(without('voltage', 'current'))),
    'duty cycle and current': ('no_voltage', 'warning', with_duty(without('voltage'))),
    'no motion': ('no_motion_measured', 'warning', without('speed', 'position')),
    'no output': ('no_output', 'error', without('speed', 'position', 'current')),
    'one direction': ('one_direction', 'warning', lambda r: r.select(['voltage'])
                      .with_signal('speed', np.abs(r['speed']) + 1, 'rad/s')),
    'short': ('few_samples', 'warning', lambda r: r.slice(0, 150)),
}  # fmt: skip


def test_nothing_is_said_about_good_data() -> None:
    assert found(GOOD) == {}
    assert found(with_encoder(GOOD)) == {}


def test_a_slow_motion_in_counts_is_no_slow_update() -> None:
    """One count in every third sample, for all of the record."""
    lattice = 2 * np.pi / 2000
    position = np.floor(np.arange(6000) / 3.0) * lattice
    record = GOOD.with_signal('position', position, 'rad').select(['voltage', 'position'])
    assert 'slow_updates' not in found(record)


@pytest.mark.parametrize('case', SPOILT)
def test_spoilt_data_is_noticed(case: str) -> None:
    code, severity, spoil = SPOILT[case]
    findings = found(spoil(GOOD))
    assert code in findings
    finding = findings[code]
    assert finding.severity == severity
    assert finding.consequence
    assert finding.remedy
    if severity == 'error':
        with pytest.raises(UserError):
            require_usable(findings.values())


def test_a_moment_of_braking_between_two_gaps_tells_no_sign() -> None:
    """... but a piece that is long enough does, and so does one that is alone."""
    whole = motor_record()
    braking = scaled('speed', -1)(whole)
    assert 'speed_sign' not in found([whole, braking.slice(0, len(whole) // 20)])
    assert 'speed_sign' in found([whole, braking])
    assert 'speed_sign' in found(braking)


def test_the_doctor_tells_what_makes_a_duty_cycle_an_input() -> None:
    for case in ('duty cycle alone', 'duty cycle and current'):
        code, _, spoil = SPOILT[case]
        assert '`supply_voltage: {constant: 24}`' in found(spoil(GOOD))[code].remedy
    alone = SPOILT['duty cycle alone'][2](GOOD)
    assert 'no_input' not in found(alone.with_signal('torque', GOOD['current'], 'N m'))


def logged(count: int, early: bool, gain: float = 0.0) -> Record:
    """Return speed counts of a motor of 28 ms at 50 Hz; with a gain its speed is controlled.

    Early: the voltage of each row is the one that was applied before the speed was read.
    """
    rng = np.random.default_rng(11)
    wanted = np.repeat(rng.uniform(-9, 9, 1 + count // 20), 20)[:count]
    volts, speeds, speed = np.zeros(count), np.zeros(count), 0.0
    pole = np.exp(-0.02 / 0.028)
    for k in range(count):
        speeds[k] = 0.25 * np.floor(speed / 0.25)
        volts[k] = wanted[k] + gain * (wanted[k] - speeds[k] / 1.8)
        speed = pole * speed + (1 - pole) * 1.8 * volts[k]
    if early:
        volts = np.concatenate(([0.0], volts[:-1]))
    columns = {'voltage': volts, 'speed': speeds}
    return Record(0.02 * np.arange(count), columns, {'voltage': 'V', 'speed': 'rad/s'})


@pytest.mark.parametrize('gain', [0.0, 0.5])
def test_a_speed_that_answers_within_its_row_without_a_current_to_tell(gain: float) -> None:
    assert found(logged(1500, True))['early_response'].numbers['share'] > 0.3
    assert 'early_response' not in found(logged(1500, False, gain))
    assert 'early_response' not in found(logged(60, True))


@pytest.mark.parametrize('factor', [RPM, DEG, 1 / (2 * np.pi)])
def test_unit_of_a_speed_without_position_from_the_encoder_steps(factor: float) -> None:
    record = without('position')(with_encoder(GOOD))
    assert 'speed_unit' not in found(record)
    assert found(scaled('speed', factor)(record))['speed_unit'].severity == 'error'


def test_rounded_numbers_are_not_taken_for_counts_for_sure() -> None:
    """Steps of 0.01 rad/s at 50 Hz would be one count of 5000 per turn, were they turns/s."""
    record = without('position', 'current')(GOOD)
    every = Record(GOOD.time[::20], {name: record[name][::20] for name in record}, record.units)
    slow = 0.004 * every['speed']
    finding = found(every.with_signal('speed', slow.round(2), 'rad/s'))['speed_unit']
    assert finding.severity == 'warning'
    assert 'unless its numbers are rounded' in finding.message
    coarse = (slow / 0.05).round() * 0.05
    assert found(every.with_signal('speed', coarse, 'rad/s'))['speed_unit'].severity == 'error'


@pytest.mark.parametrize(('times', 'told'), [(1, False), (4, True)])
def test_a_steady_voltage_under_a_speed_that_comes_and_goes(times: int, told: bool) -> None:
    """A fan on a speed controller, logged with the voltage of its battery; and a single start."""
    time = np.arange(0, 8, 0.005)
    speed = 900.0 * np.abs(np.sin(np.pi * times / 16 * time))
    volts = 24.9 - 0.5 * speed / 900.0
    units = {'voltage': 'V', 'speed': 'rad/s'}
    record = Record(time, {'voltage': volts, 'speed': speed}, units)
    assert ('voltage_of_supply' in found(record)) == told


def test_a_steady_voltage_beside_a_torque_does_not_stop_anything() -> None:
    """The bus voltage of a drive that tells its torque."""
    bus = SPOILT['voltage of the supply'][2](GOOD)
    assert found(bus)['voltage_of_supply'].severity == 'error'
    torque = bus.with_signal('torque', 0.05 * bus['current'], 'N m')
    assert found(torque)['voltage_of_supply'].severity == 'warning'


def test_unit_of_a_smooth_speed_from_the_data_sheet() -> None:
    record = without('position')(GOOD)
    assert found(record, k_e=0.05) == {}
    assert found(scaled('speed', RPM)(record), k_e=0.05)['speed_unit'].severity == 'error'
    assert found(scaled('speed', 4)(record), k_e=0.05)['back_emf_constant']


def test_irregular_time() -> None:
    rng = np.random.default_rng(0)
    jittery = Record(np.cumsum(rng.uniform(0.2, 1.8, 6000)) * 1e-3, GOOD.signals, GOOD.units)
    assert 'jitter' in found(jittery)
    kept = rng.random(6000) > 0.05
    holes = Record(
        GOOD.time[kept], {n: GOOD[n][kept] for n in GOOD}, GOOD.units
    )  # fmt: skip
    missing = found(holes)['missing_samples']
    assert missing.numbers['missing'] == pytest.approx(np.sum(~kept), abs=3)


def test_a_rest_is_no_fault_though_its_speed_is_filtered() -> None:
    """A filter still shows a thousandth of the top speed when the shaft stands."""
    rest = slice(2000, 3000)
    for share, told in ((1e-3, False), (0.5, True)):
        position, speed = GOOD['position'].copy(), GOOD['speed'].copy()
        position[rest] = position[1999]
        speed[rest] = share * np.max(speed) * np.linspace(1.0, 0.5, 1000)
        record = GOOD.with_signal('position', position, 'rad').with_signal('speed', speed, 'rad/s')
        assert ('frozen_stretch' in found(record)) == told


def test_a_drive_that_is_switched_off_is_told() -> None:
    """For the first tenth the command is there and the motor is not."""
    off = np.arange(6000) < 600
    volts = np.where(off, 0.8 * np.max(GOOD['voltage']), GOOD['voltage'])
    idle = GOOD.with_signal('voltage', volts, 'V')
    idle = idle.with_signal('speed', np.where(off, 0.0, GOOD['speed']), 'rad/s')
    told = found(without('position', 'current')(idle))['driven_at_rest']
    assert told.numbers['lasts_s'] == pytest.approx(0.6, abs=0.01)
    assert 'driven_at_rest' not in found(GOOD)


def test_an_input_without_its_direction_is_told() -> None:
    unsigned = GOOD.with_signal('voltage', np.abs(GOOD['voltage']), 'V')
    codes = found(without('position', 'current')(unsigned))
    assert codes['unsigned_input'].severity == 'warning'
    assert 'direction' in codes['unsigned_input'].remedy
    assert 'unsigned_input' not in found(without('position', 'current')(GOOD))


@pytest.mark.parametrize('name', ['current', 'speed'])
def test_a_signal_without_its_direction_is_told(name: str) -> None:
    """Of a motor that only ever turns one way, or is only ever driven one way, nothing is."""
    codes = found(GOOD.with_signal(name, np.abs(GOOD[name]), GOOD.units[name]))
    assert codes[f'unsigned_{name}'].severity == 'error'
    assert name in codes[f'unsigned_{name}'].remedy
    assert re.search(r'between [\d.]+ and [\d.]+ (A|rad/s) all', codes[f'unsigned_{name}'].message)
    assert f'unsigned_{name}' not in found(GOOD)
    lifted = GOOD.with_signal('speed', GOOD['speed'] + 2 * np.max(GOOD['speed']), 'rad/s')
    slope = np.polyfit(GOOD['speed'], GOOD['voltage'], 1)[0]
    volts = GOOD['voltage'] + slope * 2 * np.max(GOOD['speed'])
    assert 'unsigned_speed' not in found(lifted.with_signal('voltage', volts, 'V'))


def test_motor_that_never_moves() -> None:
    still = GOOD.with_signal('speed', np.zeros(6000), 'rad/s')
    codes = found(without('position')(still))
    assert codes['no_motion'].severity == 'warning'
    assert found(without('position', 'current')(still))['no_motion'].severity == 'error'


@pytest.mark.parametrize(('lasts', 'start'), [(0.4, 0.0), (20.0, 0.0), (20.0, 2.0)])
def test_a_step_response_is_usable_however_long_it_lasts_after_the_step(
    lasts: float, start: float
) -> None:
    """The voltage is one and the same from the first row on: speed tells of start or stop."""
    time = np.arange(0, lasts, 0.01)
    speed = 10.0 * (1.0 + (start - 1.0) * np.exp(-time / 0.1))
    speed += 0.05 * np.random.default_rng(0).standard_normal(time.size)
    units = {'voltage': 'V', 'speed': 'rad/s'}
    record = Record(time, {'voltage': np.full(time.size, 9.6), 'speed': speed}, units)
    assert found(record)['constant_input'].severity.value == 'warning'


def test_inputs_that_differ_from_record_to_record_are_not_constant() -> None:
    time = np.arange(0, 4, 0.01)
    units = {'voltage': 'V', 'speed': 'rad/s'}

    def step(volts: float) -> Record:
        speed = volts * (1.0 - np.exp(-time / 0.1))
        return Record(time, {'voltage': np.full(time.size, volts), 'speed': speed}, units)

    assert 'constant_input' in found(step(6.0))
    assert 'constant_input' not in found([step(6.0), step(-3.0)])


def test_a_steady_speed_under_a_constant_voltage_tells_of_no_motion() -> None:
    time = np.arange(0, 10, 0.01)
    speed = 10.0 + 0.05 * np.random.default_rng(0).standard_normal(time.size)
    speed[0] = 3.0
    units = {'voltage': 'V', 'speed': 'rad/s'}
    record = Record(time, {'voltage': np.full(time.size, 9.6), 'speed': speed}, units)
    assert found(record)['constant_input'].severity.value == 'error', 'a stray is no start'


def test_rate_and_length_against_the_motor() -> None:
    slow = Record(
        GOOD.time[::100], {name: GOOD[name][::100] for name in ('voltage', 'speed')}, GOOD.units
    )
    infos = {finding.code for finding in examine(GOOD.slice(0, 6000))}
    assert {'rate', 'excitation'} <= infos
    step = np.repeat([0.0, 6.0], 1000)
    speed = 6 / 0.05 * (1 - np.exp(-np.maximum(np.arange(2000) - 1000, 0) * 1e-3 / 2.0))
    short = Record(np.arange(2000) * 1e-3, {'voltage': step, 'speed': speed}, GOOD.units)
    assert 'too_short' in found(short)
    assert 'too_slow' in found(slow) or len(slow) < 100


def test_electrical_part_is_invisible_at_200_hz(data_dir: Path) -> None:
    record = load(data_dir / 'hidden_effect_cases' / 'motor_d' / 'train_1.csv.gz').records
    assert 'electrical_invisible' in {finding.code for finding in examine(record)}


def test_encoder_is_recognised(data_dir: Path) -> None:
    cases = {'motor_a/train_1': 2000, 'motor_c/valid': 4096, 'motor_d/train_2': 1920}
    for name, counts in cases.items():
        record = load(data_dir / 'hidden_effect_cases' / f'{name}.csv.gz').records[0]
        encoder = encoder_of(record)
        assert encoder.differenced
        assert encoder.counts_per_turn == pytest.approx(counts, abs=0.01)


def test_no_false_alarm_on_real_and_realistic_records(data_dir: Path) -> None:
    """All training and validation records; motor_c really is late, its effect is a delay."""
    for path in sorted((data_dir / 'hidden_effect_cases').glob('*/*.csv.gz')):
        expected = {'late_response'} if path.parent.name == 'motor_c' else set()
        assert set(found(list(load(path).records))) == expected, path
    emps = load(data_dir / 'emps' / 'emps_train.csv.gz', 'emps')
    assert found(list(emps.records)) == {}
    bag = load(data_dir / 'laas_cogging' / 'rosbag2' / 'accel_sine_2Hz_5s_mcap', 'laas_cogging')
    assert found(list(bag.records)) == {}


def test_every_unit_error_on_every_case(data_dir: Path) -> None:
    for path in sorted((data_dir / 'hidden_effect_cases').glob('*/valid.csv.gz')):
        record = load(path).records[0]
        for factor in (RPM, DEG, 1 / (2 * np.pi)):
            wrong = scaled('speed', factor)(record)
            assert 'speed_unit' in found(wrong), path
            assert 'speed_unit' in found(without('position')(wrong)), path


def test_several_records_are_judged_together() -> None:
    forward = scaled('speed', 1)(GOOD)
    both = [
        r.select(['voltage', 'speed'])
        for r in (
            forward.with_signal('speed', np.abs(GOOD['speed']), 'rad/s'),
            forward.with_signal('speed', -np.abs(GOOD['speed']), 'rad/s'),
        )
    ]
    assert 'one_direction' in found(both[0])
    assert 'one_direction' not in found(both)
    assert {f.code: f for f in examine(both)}['rate'].numbers['records'] == 2


def test_slope_and_balance() -> None:
    slope = slope_of(GOOD)
    assert slope is not None
    assert slope.ratio == pytest.approx(1, abs=1e-3)
    balance = voltage_balance(GOOD)
    assert balance is not None
    assert balance.back_emf == pytest.approx(0.05, rel=0.1)
    assert balance.resistance == pytest.approx(2, rel=0.1)


NAMES = ['voltage', 'duty', 'current', 'speed', 'position', 'force', 'voltage_q', 'current_q',
         'speed_reference', 'temperature', 'hall_sector']  # fmt: skip


@given(
    st.lists(st.sampled_from(NAMES), min_size=1, unique=True),
    st.integers(2, 400),
    st.sampled_from(['zeros', 'ones', 'normal', 'steps', 'huge', 'tiny', 'ramp']),
    st.integers(0, 9),
    st.booleans(),
)
def test_any_record_gets_findings(
    names: list[str], count: int, shape: str, seed: int, regular: bool
) -> None:
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((len(names), count))
    values = {
        'zeros': 0 * noise, 'ones': 0 * noise + 1, 'normal': noise, 'steps': np.round(noise),
        'huge': noise * 1e150, 'tiny': noise * 1e-200, 'ramp': noise.cumsum(axis=1),
    }[shape]  # fmt: skip
    time = np.cumsum(np.full(count, 1e-3) if regular else rng.uniform(1e-4, 1, count))
    record = Record(time, dict(zip(names, values, strict=True)), dict.fromkeys(names, '1'))
    for finding in examine(record):
        assert finding.message
        assert json.loads(json.dumps(finding.to_dict(), allow_nan=False))['code'] == finding.code


def test_every_code_is_documented(repository: Path) -> None:
    """A code that the package can give stands in docs/check.md."""
    package = repository / 'motor_sysid'
    text = (repository / 'docs' / 'check.md').read_text()
    files = [*(package / 'recording').glob('*.py'), *(package / 'signals' / 'checks').glob('*.py')]
    codes = {
        code
        for file in files
        for code in re.findall(r"Severity\.\w+[^,]*?,\s*'(\w+)'", file.read_text())
    }
    assert len(codes) > 40
    assert {code for code in codes if f'`{code}`' not in text} == set()


@pytest.mark.parametrize(('loop', 'steady'), [(1.05, True), (1.36, True), (1.0, False)])
def test_stamps_of_whole_milliseconds_lose_no_samples(loop: float, steady: bool) -> None:
    """A loop of 1.36 ms has steps of 1, 1, 2, 1, 2 ms; one of 1 ms that loses a fifth, too."""
    rng = np.random.default_rng(0)
    kept = np.ones(6000, dtype=bool) if steady else rng.random(6000) > 0.2
    stamps = np.round(loop * np.arange(6000))[kept] * 1e-3
    record = Record(stamps, {n: GOOD[n][kept] for n in GOOD}, GOOD.units)
    assert ('missing_samples' in found(record)) == (not steady)
