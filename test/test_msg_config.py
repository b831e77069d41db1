"""msg_config files: what they may say, how they are refused, and that the shipped ones work."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from recording_tools import MS, START, types, vector, write_bag

from motor_sysid.errors import UserError
from motor_sysid.recording import load, load_msg_config
from motor_sysid.recording.field_path import parse_path
from motor_sysid.recording.msg_config import parse_msg_config
from motor_sysid.resources import shipped_directory

SHIPPED = sorted(path.stem for path in shipped_directory('msg_config').glob('*.yaml'))


def csv(path: Path, header: str, count: int = 30) -> Path:
    others = range(1, header.count(',') + 1)
    rows = [','.join([f'{0.01 * k:.3f}', *(str(k + i) for i in others)]) for k in range(count)]
    path.write_text('\n'.join([header, *rows]))
    return path


def config(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.parametrize('name', SHIPPED)
def test_shipped_files_are_valid_and_say_what_they_are(name: str) -> None:
    assert load_msg_config(name).description


@pytest.mark.parametrize(
    ('name', 'file', 'signals', 'records'),
    [
        ('emps', 'emps/emps_train.csv.gz', {'position', 'force', 'position_reference'}, 1),
        ('bam_xl330', 'bam_xl330/kp100_sin_sin.csv.gz', {'voltage', 'duty', 'speed'}, 1),
        ('wpilib_sysid', 'frc_sysid/team581_2022_intake_roller.csv.gz', {'voltage', 'speed'}, 4),
        ('wpilib_sysid_drivetrain', 'frc_sysid/team5409_2022_drivetrain.csv.gz', {'speed'}, 4),
        ('odrive', 'odrive_maxon/step1.csv.gz', {'voltage', 'position', 'speed'}, 1),
        ('laas_cogging', 'laas_cogging/accel_sine_2Hz.csv.gz', {'voltage_q', 'current_q'}, 1),
        ('laas_cogging', 'laas_cogging/rosbag2/accel_sine_2Hz_5s_sqlite3', {'voltage_q'}, 1),
        ('feetech_sts3215', 'servo_backlash/motor_telemetry_comp2.csv.gz', {'position'}, 1),
    ],
)
def test_shipped_files_read_real_records(
    data_dir: Path, name: str, file: str, signals: set[str], records: int
) -> None:
    loaded = load(data_dir / file, name)
    assert len(loaded.records) == records
    assert signals <= set(loaded.records[0])


def test_a_log_of_a_vesc_is_read_in_both_axes_at_the_shaft(tmp_path: Path) -> None:
    names = 'ms_today;input_voltage;temp_motor;d_axis_current;q_axis_current;erpm;duty_cycle;'
    path = tmp_path / 'log.csv'
    rows = [f'{20 * k};{24 - 0.1 * k};31;0.1;{k};{700 * k};0.05;0.2;{0.3 * k};' for k in range(9)]
    path.write_text('\n'.join([f'{names}d_axis_voltage;q_axis_voltage;', *rows]))
    record = load(path, 'vesc').records[0]
    k = np.arange(9)
    assert record.time == pytest.approx(0.02 * k)
    assert record['speed'] == pytest.approx(100 * k * 2 * np.pi / 60), 'seven pole pairs'
    assert record['voltage_q'] == pytest.approx(0.3 * k)
    assert record['current_q'] == pytest.approx(k)
    assert record['supply_voltage'] == pytest.approx(24 - 0.1 * k)
    assert 'voltage' not in record


def test_emps_force(data_dir: Path) -> None:
    record = load(data_dir / 'emps' / 'emps_train.csv.gz', 'emps').records[0]
    assert record.units == {'position': 'm', 'force': 'N', 'position_reference': 'm'}
    assert record['force'][0] == pytest.approx(2.53862809 * 35.1507)


def test_derived_signals_constants_and_gear(tmp_path: Path) -> None:
    path = csv(tmp_path / 'a.csv', 't,pwm,battery,count,amp')
    text = """
time: {column: t, unit: ms}
signals:
  voltage: {product: [duty, supply_voltage], unit: V}
  duty: {column: pwm, unit: '%'}
  supply_voltage: {sum: [_battery, _drop]}
  _battery: {column: battery, unit: V}
  _drop: {constant: -0.5, unit: V}
  position: {column: count, unit: counts, counts_per_turn: 400, gear_ratio: 10, sign: -1}
  current: {column: amp, unit: mA, scale: 2, offset: 1}
  temperature: {column: absent, optional: true}
"""
    record = load(path, config(tmp_path / 'a.yaml', text)).records[0]
    k = np.arange(30)
    assert set(record) == {'voltage', 'duty', 'supply_voltage', 'position', 'current'}
    assert record.time == pytest.approx(1e-5 * k)
    assert record['voltage'] == pytest.approx(0.01 * (k + 1) * (k + 2 - 0.5))
    assert record['position'] == pytest.approx(-(k + 3) * 2 * np.pi / 400 / 10)
    assert record['current'] == pytest.approx((2 * (k + 4) + 1) * 1e-3)


@pytest.mark.parametrize(
    ('header', 'origins'),
    [
        ('t,pwm,battery', {'supply_voltage': 'battery', 'voltage': 'duty * _battery'}),
        ('t,pwm', {'supply_voltage': '24', 'voltage': '12'}),
    ],
)
def test_the_origin_is_the_source_that_was_used(
    tmp_path: Path, header: str, origins: dict[str, str]
) -> None:
    path = csv(tmp_path / 'a.csv', header)
    text = (
        'time: t\nsignals:\n  duty: {column: pwm}\n'
        '  supply_voltage: [{column: battery, optional: true}, {constant: 24}]\n'
        '  _battery: {column: battery, optional: true}\n'
        '  voltage: [{product: [duty, _battery], optional: true}, {constant: 12}]\n'
    )
    assert load(path, config(tmp_path / 'a.yaml', text)).origins == {'duty': 'pwm', **origins}


def test_a_gear_divides_motion_and_multiplies_forces(tmp_path: Path) -> None:
    path = csv(tmp_path / 'a.csv', 't,v,a,m,x')
    text = (
        'time: t\nsignals:\n  speed: {column: v, gear_ratio: 10}\n'
        '  acceleration: {column: a, gear_ratio: 10}\n  torque: {column: m, gear_ratio: 10}\n'
    )
    record = load(path, config(tmp_path / 'a.yaml', text)).records[0]
    k = np.arange(30)
    assert record['speed'] == pytest.approx((k + 1) / 10)
    assert record['acceleration'] == pytest.approx((k + 2) / 10)
    assert record['torque'] == pytest.approx((k + 3) * 10)


@pytest.mark.parametrize('gear', [50, 1, 0.5])
def test_an_encoder_that_wraps_before_a_gear_is_made_continuous(
    tmp_path: Path, gear: float
) -> None:
    """A turn of the sensor's shaft is a fraction of one of the record's, or several."""
    angle = np.linspace(0, 200, 500)
    counts = (angle * 4096 / (2 * np.pi)).astype(int) % 4096
    text = (
        '  position: {WHERE, unit: counts, counts_per_turn: 4096, '
        f'gear_ratio: {gear}}}\n  voltage: {{ELSE}}\n'
    )
    table = tmp_path / 'a.csv'
    table.write_text('t,p,u\n' + ''.join(f'{k / 1000},{x},1\n' for k, x in enumerate(counts)))
    tabled = text.replace('WHERE', 'column: p').replace('ELSE', 'column: u')
    messages = [(START + k * MS, vector(START + k * MS, x, 1)) for k, x in enumerate(counts)]
    bag = write_bag(tmp_path / 'bag', {'/a': ('geometry_msgs/msg/Vector3Stamped', messages)})
    topical = text.replace('WHERE', 'topic: /a, field: vector.x')
    topical = topical.replace('ELSE', 'topic: /a, field: vector.y')
    for path, signals in ((table, f'time: t\nsignals:\n{tabled}'), (bag, f'signals:\n{topical}')):
        (record,) = load(path, config(tmp_path / 'a.yaml', signals)).records
        assert record['position'] == pytest.approx(angle / gear, abs=2 * np.pi / 4096 / gear)


@pytest.mark.parametrize(('shift', 'kept'), [(-1, 28), (2, 26), (0, 30)])
def test_values_move_by_rows_within_their_segment(tmp_path: Path, shift: int, kept: int) -> None:
    """The voltage of a row was applied up to then: it belongs to the row before."""
    path = tmp_path / 'a.csv'
    rows = [f'{k // 15},{0.01 * k:.2f},{k},{k + 1}' for k in range(30)]
    path.write_text('\n'.join(['test,t,v,u', *rows]))
    text = (
        'time: t\nsegment_by: test\n'
        f'signals: {{speed: {{column: v}}, voltage: {{column: u, shift: {shift}}}}}'
    )
    records = load(path, config(tmp_path / 'a.yaml', text)).records
    assert sum(map(len, records)) == kept
    for record in records:
        assert record['voltage'] == pytest.approx(record['speed'] + 1 - shift)


def test_segments_keep_their_names(tmp_path: Path) -> None:
    path = tmp_path / 'a.csv'
    rows = [f'{test},{0.01 * k:.2f},{k}' for test in ('slow', 'fast', 'slow') for k in range(20)]
    path.write_text('\n'.join(['test,t,v', *rows]))
    text = 'time: t\nsegment_by: test\nsignals: {speed: {column: v}}'
    loaded = load(path, config(tmp_path / 'a.yaml', text))
    assert [r.provenance.notes[0] for r in loaded.records] == [
        'part `slow`', 'part `fast`', 'part `slow`'
    ]  # fmt: skip
    assert loaded.findings == ()


def test_dates_as_time(tmp_path: Path) -> None:
    rows = [f'2025-11-12T10:03:{k:02d}.5Z,{k}' for k in range(20)]
    path = tmp_path / 'a.csv'
    path.write_text('\n'.join(['when,v', *rows]))
    text = 'time: {column: when, unit: iso8601}\nsignals: {speed: {column: v}}'
    assert load(path, config(tmp_path / 'a.yaml', text)).records[0].time[3] == 3
    path.write_text('when,v\nyesterday,1\ntoday,2\n')
    with pytest.raises(UserError, match='line 2, column `when`: `yesterday` is not a date; 2 of'):
        load(path, tmp_path / 'a.yaml')


def dated(count: int = 300) -> list[str]:
    return [f'2025-11-12T10:03:29.{k:03d}Z,{k},{k // 150}' for k in range(count)]


@pytest.mark.parametrize(
    ('row', 'line', 'kept', 'code'),
    [
        (250, ',250,1', 299, 'missing_values'),
        (0, ',0,0', 299, 'missing_values'),
        (7, 'null,7,0', 299, 'missing_values'),
        (7, 'today,7,0', 299, 'text_in_number_column'),
        (299, '2025-11-12T10:03', 299, 'broken_lines'),
        (9, '# a comment', 299, ''),
        (9, '  # another', 299, ''),
        (0, '2025-11-12T11:03:29.000+01:00,0,0', 300, ''),
    ],
)
@pytest.mark.filterwarnings('error')
def test_one_odd_row_among_dates_costs_no_other(
    tmp_path: Path, row: int, line: str, kept: int, code: str
) -> None:
    """Time, signals and names of segments keep the same rows."""
    rows = dated()
    rows[row] = line
    path = tmp_path / 'a.csv'
    path.write_text('\n'.join(['when,v,test', *rows]))
    text = 'time: {column: when, unit: iso8601}\nsegment_by: test\nsignals: {speed: {column: v}}'
    loaded = load(path, config(tmp_path / 'a.yaml', text))
    assert sum(map(len, loaded.records)) == kept
    assert [one.provenance.notes[0] for one in loaded.records] == ['part `0`', 'part `1`']
    begin = line == ',0,0'
    for one in loaded.records:
        assert one.time == pytest.approx((one['speed'] - begin) / 1000)
    found = {finding.code for finding in loaded.findings} - {'missing_values'}
    assert found == {code} - {'missing_values', ''}


@pytest.mark.parametrize(
    ('dates', 'message'),
    [('', 'column `when` holds no date'), ('7', '`7` is not a date; 20 of 20'),
     ('today', '`today` is not a date; 20 of 20')],
)  # fmt: skip
def test_what_holds_no_dates_is_refused(tmp_path: Path, dates: str, message: str) -> None:
    path = tmp_path / 'a.csv'
    path.write_text('when,v\n' + f'{dates},1\n' * 20)
    text = 'time: {column: when, unit: iso8601}\nsignals: {speed: {column: v}}'
    with pytest.raises(UserError, match=message):
        load(path, config(tmp_path / 'a.yaml', text))


ARRAY = "signals: {speed: {topic: drive, field: 'data[2]'}}"


def test_array_topic_with_its_own_clock(tmp_path: Path) -> None:
    """Float64MultiArray has no header; the driver's clock in ms is its first number."""
    name = 'std_msgs/msg/Float64MultiArray'
    layout = types().types['std_msgs/msg/MultiArrayLayout'](dim=[], data_offset=0)
    rows = []
    for k in range(40):
        data = np.array([5000.0 + 2 * k, 3.0 * k, -k])
        message = types().types[name](layout=layout, data=data)
        rows.append((START + 7 * k * MS, bytes(types().serialize_cdr(message, name))))
    bag = write_bag(tmp_path / 'bag', {'/drive': (name, rows)})
    text = """
stamp: 'data[0]'
signals:
  voltage: {topic: drive, field: 'data[1]', unit: mV, stamp_unit: ms, stamp: 'data[0]'}
  speed: {topic: drive, field: 'data[2]', unit: rpm, stamp_unit: ms}
"""
    record = load(bag, config(tmp_path / 'a.yaml', text)).records[0]
    assert record.dt == pytest.approx(0.002)
    assert record['voltage'][10] == pytest.approx(0.03)
    with pytest.raises(UserError, match='no header stamp; write `stamp: receive`'):
        load(bag, config(tmp_path / 'b.yaml', ARRAY))
    receive = f'stamp: receive\n{ARRAY}'
    assert load(bag, config(tmp_path / 'c.yaml', receive)).records[0].dt == pytest.approx(0.007)


SPEED = 'signals: {speed: {column: v}}'


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('', '`signals` is missing'),
        ('signals: {}', '`signals` is missing'),
        ('- a', 'must be a mapping'),
        ('signals: [a]', '`signals` must be a mapping'),
        ('a: {', 'not a YAML file'),
        ('a: 2025-13-01', 'not a YAML file: month must be'),
        ('{[a]: 1}', 'unhashable key'),
        ('signal: {}', r'has no key `signal` \(did you mean `signals`\?\); allowed are'),
        ('signals: {speeed: {column: v}}', r'is not a signal \(did you mean `speed`'),
        ('signals: {speed: {colum: v}}', r'has no key `colum` \(did you mean `column'),
        ('signals: {speed: {}}', 'needs exactly one of topic, column'),
        ('signals: {speed: {column: v, topic: t}}', r'exactly one of .* has \['),
        ('signals: {speed: {topic: t}}', 'needs `field`'),
        ('signals: {speed: {column: v, field: x}}', '`field` goes with `topic` only'),
        ('signals: {speed: {topic: t, field: "a[b"}}', r'field path `a\[b` cannot be read'),
        ('signals: {speed: {column: v, unit: furlong}}', 'unit `furlong` is not known'),
        ('signals: {speed: {column: v, unit: V}}', 'which is no unit of it'),
        ('signals: {speed: {column: v, unit: counts/s}}', 'add `counts_per_turn: N`'),
        ('signals: {speed: {column: v, scale: fast}}', '`signals.speed.scale` must be a number'),
        ('signals: {speed: {column: v, scale: 0}}', '`scale` is 0'),
        ('signals: {speed: {column: v, sign: 2}}', 'must be 1 or -1, not 2'),
        ('signals: {speed: {column: v, gear_ratio: -3}}', 'must be above 0'),
        ('signals: {current: {column: v, gear_ratio: 10}}', '`gear_ratio`, which goes with posi'),
        ('signals: {_load: {column: v, gear_ratio: 10}}', 'write another ratio as `scale`'),
        ('signals: {speed: {column: v, shift: 0.5}}', '`signals.speed.shift` must be a whole'),
        ('signals: {speed: {topic: t, field: x, shift: 1}}', '`shift` goes with `column` only'),
        ('signals: {speed: {column: [1]}}', 'must be a text'),
        ('signals: {speed: {column: v}, speed: {column: w}}', 'key `speed` stands twice'),
        ('signals: {voltage: {product: [duty]}, speed: {column: v}}', 'computed from `duty`'),
        ('signals: {duty: {sum: [_a]}, _a: {sum: [duty]}, speed: {column: v}}', 'circle'),
        ('signals: {speed: {column: v, scale: .nan}}', 'must be a number'),
        ('signals: {speed: {column: v, optional: maybe}}', 'must be true or false'),
        ('signals: {voltage: {constant: 3}}', 'reads nothing'),
        (SPEED + '\nbase_clock: sped', '`sped` is not among the signals'),
        (SPEED + '\ntime: {unit: s}', 'needs `column: HEADER`'),
        (SPEED + '\ntime: {column: t, unit: V}', 'must be a time'),
        (SPEED + '\nmax_gap: long', '`max_gap` must be a number'),
        (SPEED + '\nmax_gap: ' + '9' * 400, '`max_gap` must be a number'),
        (SPEED + '\nmax_gap: -1', '`max_gap` is -1 s, must be above 0; leave it out for the def'),
        (SPEED + '\nmax_gap: 0', '`max_gap` is 0 s, must be above 0'),
        ('signals: {speed: {column: v}, torque: {product: []}}', 'torque.product` is empty'),
        ('signals: {speed: {column: ""}}', '`signals.speed.column` is empty; name what'),
        ('signals: {speed: {topic: t, field: x, when: {are: dq}}}', 'has no key `are`'),
    ],
)
def test_what_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = config(tmp_path / 'mine.yaml', text)
    with pytest.raises(UserError, match=message) as error:
        load_msg_config(path)
    assert str(path) in str(error.value)


def test_missing_files_and_columns(tmp_path: Path) -> None:
    path = csv(tmp_path / 'a.csv', 't,v')
    with pytest.raises(UserError, match=r'nowhere\.yaml does not exist'):
        load(path, tmp_path / 'nowhere.yaml')
    with pytest.raises(UserError, match='is a folder; name a file in it'):
        load(path, tmp_path)
    (tmp_path / 'latin.yaml').write_bytes(b'description: M\xfcller\n')
    with pytest.raises(UserError, match=r'latin\.yaml cannot be read: .* save it as UTF-8'):
        load(path, tmp_path / 'latin.yaml')
    with pytest.raises(UserError, match=r'msg_config has no `emp`; it has .*emps'):
        load(path, 'emp')
    with pytest.raises(UserError, match='names no time column'):
        load(path, config(tmp_path / 'a.yaml', SPEED))
    with pytest.raises(UserError, match='no column `w`; its columns are t, v'):
        load(path, config(tmp_path / 'b.yaml', 'time: t\nsignals: {speed: {column: w}}'))
    with pytest.raises(UserError, match='names no column'):
        load(path, config(tmp_path / 'c.yaml', 'time: t\nsignals: {speed: {topic: a, field: x}}'))
    signals = 'voltage: {product: [duty]}, duty: {column: d, optional: true}, speed: {column: v}'
    text = f'time: t\nsignals: {{{signals}}}'
    with pytest.raises(UserError, match='computed from duty, which the data lacks'):
        load(path, config(tmp_path / 'd.yaml', text))


def test_paths() -> None:
    steps = parse_path('interface_values[joint_names=a.b].values[interface_names=velocity]')
    assert [(s.field, s.key, s.text) for s in steps] == [
        ('interface_values', 'joint_names', 'a.b'), ('values', 'interface_names', 'velocity')
    ]  # fmt: skip
    assert [s.index for s in parse_path('data[3].x')] == [3, None]


VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(-3, 3), st.floats(), st.text(max_size=8)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(st.sampled_from(['column', 'topic', 'field', 'x']), inner, max_size=3),
    ),
    max_leaves=8,
)


@given(st.dictionaries(st.sampled_from(['signals', 'time', 'stamp', 'max_gap']), VALUES), VALUES)
def test_any_content_is_a_config_or_a_user_error(top: dict[str, object], speed: object) -> None:
    top['signals'] = {'speed': speed, '_x': {'constant': 1}}
    try:
        found = parse_msg_config(top)
    except UserError:
        return
    assert 'speed' in found.sources
