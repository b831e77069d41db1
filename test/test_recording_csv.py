"""CSV files: headers, delimiters, holes, text where numbers should be, times that jump."""

import gzip
from pathlib import Path
import time

from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from recording_tools import motor_record

from motor_sysid.errors import UserError
from motor_sysid.recording import load, Loaded
from motor_sysid.recording.headers import understand
from motor_sysid.recording.save import write_record
from motor_sysid.recording.table import read_table


def codes(loaded: Loaded) -> set[str]:
    return {finding.code for finding in loaded.findings}


def table(path: Path, header: str, rows: list[str]) -> Path:
    path.write_text('\n'.join([header, *rows, '']), encoding='utf8')
    return path


def ramp(count: int = 200, dt: float = 0.001) -> list[str]:
    return [f'{dt * k:.6f},{k % 12},{0.5 * k}' for k in range(count)]


HEADER = 'time [s],voltage [V],speed [rad/s]'


@pytest.mark.parametrize(
    ('header', 'signal', 'unit'),
    [
        ('time [s]', 'time', 's'), ('t_s', 'time', 's'), ('time_ms', 'time', 'ms'),
        ('voltage_v', 'voltage', 'V'), ('speed_rad_s', 'speed', 'rad/s'),
        ('Speed (RPM)', 'speed', 'RPM'), ('speed reference [rad/s]', 'speed_reference', 'rad/s'),
        ('voltage_d [V]', 'voltage_d', 'V'), ('current_a', 'current', 'A'),
        ('current_a [A]', 'current_a', 'A'), ('position_deg', 'position', 'deg'),
        ('velocity_m_s', 'speed', 'm/s'), ('temperature_C', 'temperature', 'degC'),
        ('voltage', 'voltage', ''), ('hall_sector [-]', 'hall_sector', '-'),
    ],
)  # fmt: skip
def test_headers(header: str, signal: str, unit: str) -> None:
    found = understand(header, [header])
    assert found is not None
    assert (found.signal, found.unit) == (signal, unit)


def test_headers_that_are_not_ours() -> None:
    assert understand('u_V', ['u_V']) is None
    assert understand('voltage_left_V', []) is None
    phases = ['current_a', 'current_b', 'current_c']
    for there in (phases, phases[:2], phases[::2]):
        assert [understand(c, there).signal for c in there] == there  # type: ignore[union-attr]


def test_units_are_converted(tmp_path: Path) -> None:
    rows = [f'{k},{1000 * k},60,{180},{2500}' for k in range(20)]
    header = 'time_ms,voltage_mv,speed [rpm],position [deg],current_ma'
    path = table(tmp_path / 'a.csv', header, rows)
    record = load(path).records[0]
    assert record.time[1] == pytest.approx(1e-3)
    assert record['voltage'][3] == pytest.approx(3)
    assert record['speed'][0] == pytest.approx(2 * np.pi)
    assert record['position'][0] == pytest.approx(np.pi)
    assert record['current'][0] == pytest.approx(2.5)
    assert record.units == {
        'voltage': 'V', 'speed': 'rad/s', 'position': 'rad', 'current': 'A'
    }  # fmt: skip


@pytest.mark.parametrize('suffix', ['.csv', '.csv.gz'])
def test_round_trip_is_exact(tmp_path: Path, suffix: str) -> None:
    record = motor_record(300)
    write_record(record, tmp_path / f'a{suffix}')
    loaded = load(tmp_path / f'a{suffix}')
    assert loaded.records[0].digest() == record.digest()
    assert loaded.findings == ()


@pytest.mark.parametrize(
    'text',
    [
        HEADER + '\r\n0.0,1,2\r\n0.1,1,3\r\n',
        '\ufeff' + HEADER + '\n0,1,2\n0.1,1,3\n',
        '# by a logger\n\n' + HEADER + '\n# comment\n0,1,2\n0.1,1,3\n',
        HEADER.replace(',', ';') + '\n0,0;1,0;2,0\n0,1;1,0;3,0\n',
        HEADER.replace(',', '\t') + '\n0\t1\t2\n0.1\t1\t3\n',
        HEADER.replace(',', '\t') + '\n0\t1\t2,0\n0,1\t1\t3\n',
        '"time [s]","voltage [V]","speed [rad/s]","note"\n0,1,"2","a, b"\n0.1,1,3,\n',
        HEADER + ',note\n0,1,2,ok\n0.1,1,3,"x"\n',
        HEADER + '\n0,1,2\n0.1,1,3\n0.2,1',
        '# comment\n' * 150 + HEADER + '\n0,1,2\n  # comment, too\n0.1,1,3 # a, b, c\n   \n',
        HEADER + ',\n0,1,2,\n0.1,1,3, ,\n',
        '"time [s]";"voltage, of the motor [V]";"speed [rad/s]"\n0;1;2\n0,1;1;3\n',
        HEADER + '\n0,1,2\n0.1,1,3\n0.2' + '\0' * 200_000,
        'time,voltage,speed\n(s),(V),(rad/s)\n0,1,2\n0.1,1,3\n',
        'time [ms],voltage,speed\nms,Volt,\n0,1,2\n100,1,3\n',
        'time [s] voltage [V]  speed [rad/s]\n0 1 2\n0.1  1 3 \n',
        '# time[s] voltage[V] speed[rad/s]\n0 1 2\n0.1 1 3\n',
    ],
)
def test_dialects(tmp_path: Path, text: str) -> None:
    path = tmp_path / 'a.csv'
    path.write_bytes(text.encode())
    record = load(path).records[0]
    assert record.time.tolist() == [0.0, 0.1]
    assert record['speed'].tolist() == [2.0, 3.0]


@pytest.mark.parametrize(
    ('rows', 'speeds'),
    [
        (['0.00\t-1,436\t1.5', '0.01\t987\t1'], [-1436, 987]),
        (['0\t1,436\t1', '10\t987\t2', '20\t-1,234,567\t3'], [1436, 987, -1234567]),
        (['0.00\t"1,436.25"\t1', '0.01\t987\t2'], [1436.25, 987]),
        (['0,00\t1.436,5\t1', '0,01\t2.987\t2'], [1436.5, 2987]),
        (['0,00\t1,436\t1', '0,01\t987\t2'], [1.436, 987]),
        (['0\t1,436\t1', '10\t9,870\t2'], [1.436, 9.87]),
        (['0\t1,5\t1.000', '10\t2\t1.010'], [1.5, 2]),
    ],
)
def test_commas_between_thousands(tmp_path: Path, rows: list[str], speeds: list[float]) -> None:
    path = table(tmp_path / 'a.tsv', 'time [s]\tspeed [rad/s]\tvoltage [V]', rows)
    assert load(path).records[0]['speed'].tolist() == speeds


def test_an_index_without_a_name_is_a_time_if_it_holds_dates(tmp_path: Path) -> None:
    rows = [f'2025-03-01 10:00:00.{k:03},{k},1' for k in range(20)]
    path = table(tmp_path / 'a.csv', ',speed [rad/s],voltage [V]', rows)
    assert load(path).records[0].time[1] == pytest.approx(1e-3)
    rows = [f'{k},{1e-3 * k},{k},1' for k in range(20)]
    path = table(tmp_path / 'b.csv', ',time [s],speed [rad/s],voltage [V]', rows)
    assert load(path).records[0].time[1] == pytest.approx(1e-3)


def test_rows_stamped_in_bursts_have_the_pace_of_all(tmp_path: Path) -> None:
    stamps = [0.02 * (k // 10) + 1e-6 * (k % 10) for k in range(500)]
    rows = [f'{t:.6f},{k},1' for k, t in enumerate(stamps)]
    (record,) = load(table(tmp_path / 'a.csv', HEADER, rows)).records
    assert record.dt == pytest.approx(2e-3, rel=0.03)
    assert len(record.uniform()) <= 500


@pytest.mark.parametrize(
    'head',
    [
        '# time [s],voltage [V]\n', 'sep=,\ntime [s],voltage [V]\n',
        '"sep=,"\n# a motor\n#time [s],voltage [V]\n\n', '# 3,4\ntime [s],voltage [V]\n',
    ],
)  # fmt: skip
def test_headers_as_numpy_and_spreadsheets_have_them(tmp_path: Path, head: str) -> None:
    path = tmp_path / 'drive.csv'
    path.write_text(head + ''.join(f'{0.01 * k},{k}\n' for k in range(50)))
    (record,) = load(path).records
    assert len(record) == 50
    assert record['voltage'][-1] == 49.0


def test_numbers_under_a_comment_that_is_no_header_still_lack_one(tmp_path: Path) -> None:
    path = tmp_path / 'drive.csv'
    path.write_text('# written by hand, on 12 May, in Graz\n0.0,1\n0.1,2\n')
    with pytest.raises(UserError, match='has no header line'):
        load(path)


def test_columns_that_are_not_read_are_named(tmp_path: Path) -> None:
    path = table(tmp_path / 'a.csv', HEADER + ',error_code', [row + ',E7' for row in ramp()])
    (finding,) = load(path).findings
    assert finding.code == 'ignored_columns'
    assert 'error_code' in finding.message


def test_a_unit_that_has_to_be_assumed_is_said(tmp_path: Path) -> None:
    loaded = load(table(tmp_path / 'a.csv', 'time,voltage,speed', ramp()))
    assert [f.code for f in loaded.findings] == ['unit_assumed'] * 3


def test_bad_cell_is_named_and_its_row_left_out(tmp_path: Path) -> None:
    rows = ramp()
    rows[100] = '0.1,oops,3'
    loaded = load(table(tmp_path / 'a.csv', HEADER, rows))
    assert len(loaded.records[0]) == 199
    message = next(f for f in loaded.findings if f.code == 'text_in_number_column').message
    assert 'line 102, column `voltage [V]`: `oops` is not a number (1 of 200 rows)' in message


def test_many_bad_cells_are_refused(tmp_path: Path) -> None:
    rows = [row if k % 4 else f'{0.001 * k},n.a.,7' for k, row in enumerate(ramp())]
    with pytest.raises(UserError, match=r'line 2, column `voltage \[V\]`: `n.a.` .* 50 of 200'):
        load(table(tmp_path / 'a.csv', HEADER, rows))


@pytest.mark.parametrize(
    ('rows', 'message'),
    [
        ([f'{k},{row}' for k, row in enumerate(ramp())],
         r'line 2 has 4 values for 3 columns \(time .*200 of 200 lines\); numbers of rows wit'),
        ([row.replace(',', ';').replace('.', ',').replace(';', ',') for row in ramp()],
         r'line 2 has 5 values .* decimal commas between commas'),
        ([*ramp(50), '"0.05,1,2', *ramp(5)], 'line 52 has a quote that is not closed'),
        (['x' * 200_000 + row for row in ramp(3)], 'line 2 has 2000.. letters'),
    ],
)  # fmt: skip
def test_rows_that_are_none_are_refused(tmp_path: Path, rows: list[str], message: str) -> None:
    with pytest.raises(UserError, match=message):
        load(table(tmp_path / 'a.csv', HEADER, rows))


@pytest.mark.parametrize('line', ['"0.1,1,50', '0.1,"1,50', '0.1,1,5,0', '0' * 200_000])
def test_a_broken_line_costs_no_other(tmp_path: Path, line: str) -> None:
    rows = ramp()
    rows[100] = line
    loaded = load(table(tmp_path / 'a.csv', HEADER, [*rows, '0.2,']))
    assert loaded.records[0]['speed'].tolist() == [0.5 * k for k in range(200) if k != 100]
    assert codes(loaded) == {'broken_lines'}
    cut, broken = (f for f in loaded.findings)
    assert (cut.severity, cut.numbers['line']) == ('info', 202)
    assert 'the last line (202) breaks off with 2 of 3 values' in cut.message
    assert (broken.severity, broken.numbers['line']) == ('warning', 102)


def test_zeros_after_the_text_are_said(tmp_path: Path) -> None:
    path = table(tmp_path / 'a.csv', HEADER, ramp())
    path.write_bytes(path.read_bytes() + bytes(4096))
    loaded = load(path)
    assert len(loaded.records[0]) == 200
    (finding,) = loaded.findings
    assert 'ends with 4096 zeros' in finding.message


def test_empty_cells_and_not_a_number(tmp_path: Path) -> None:
    rows = ramp()
    rows[3], rows[7], rows[9], rows[11] = '0.003,,1', '0.007,1,', '0.009,nan,1', '0.011,1,inf'
    loaded = load(table(tmp_path / 'a.csv', HEADER, rows))
    assert len(loaded.records[0]) == 196
    (finding,) = loaded.findings
    assert finding.code == 'missing_values'
    assert dict(finding.numbers) == {'rows': 4, 'rows_voltage': 2, 'rows_speed': 2}


def test_column_without_any_value(tmp_path: Path) -> None:
    rows = [row + ',' for row in ramp()]
    loaded = load(table(tmp_path / 'a.csv', HEADER + ',current [A]', rows))
    assert 'current' not in loaded.records[0]
    assert codes(loaded) == {'empty_signal'}


def test_gap_and_jump_give_several_records(tmp_path: Path) -> None:
    rows = ramp()
    loaded = load(table(tmp_path / 'gap.csv', HEADER, rows[:80] + rows[120:]))
    assert [len(r) for r in loaded.records] == [80, 80]
    assert codes(loaded) == {'gap'}
    loaded = load(table(tmp_path / 'jump.csv', HEADER, rows + rows[:150]))
    assert [len(r) for r in loaded.records] == [200, 150]
    assert codes(loaded) == {'time_jumps_back'}
    loaded = load(table(tmp_path / 'twice.csv', HEADER, [rows[0], *rows]))
    assert len(loaded.records[0]) == 200
    assert codes(loaded) == {'repeated_stamps'}


@pytest.mark.parametrize('phase', [0.0, 0.0004])
def test_a_clock_set_back_within_a_step_is_no_overtaking(tmp_path: Path, phase: float) -> None:
    rows = ramp(2000)
    again = [f'{0.001 * k - phase:.6f},1,{k}' for k in range(1800, 3500)]
    loaded = load(table(tmp_path / 'a.csv', HEADER, rows + again))
    assert [len(r) for r in loaded.records] == [2000, 1700]
    assert codes(loaded) == {'time_jumps_back'}


def at_times(path: Path, steps: np.ndarray) -> Loaded:
    """Return a record whose rows follow each other by those steps, in s."""
    times = np.cumsum(np.concatenate(([0.0], steps)))
    return load(table(path, HEADER, [f'{t:.6f},1,{k}' for k, t in enumerate(times)]))


def test_irregular_sampling_is_no_gap(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    loaded = at_times(tmp_path / 'a.csv', np.where(rng.random(500) < 0.1, 0.1, 0.005))
    assert len(loaded.records) == 1
    (said,) = loaded.findings
    assert said.code == 'long_steps'
    assert '`max_gap: 0.05`' in said.remedy
    config = tmp_path / 'a.yaml'
    columns = "signals: {speed: {column: 'speed [rad/s]'}}\ntime: {column: 'time [s]'}\n"
    config.write_text(columns + 'max_gap: 0.05')
    assert len(load(tmp_path / 'a.csv', config).records) > 5
    config.write_text(columns + 'max_gap: 0.2')
    assert load(tmp_path / 'a.csv', config).findings == ()


def test_sampling_on_events_is_no_gap(tmp_path: Path) -> None:
    """Steps of every length, some of them of more than ten median steps."""
    rng = np.random.default_rng(0)
    loaded = at_times(tmp_path / 'a.csv', rng.exponential(0.005, 5000) + 1e-4)
    (record,) = loaded.records
    assert np.max(np.diff(record.time)) > 10 * record.dt
    assert loaded.findings == ()


@pytest.mark.parametrize('rows', [22, 45, 90, 300])
def test_holes_that_come_again_and_again_are_gaps(tmp_path: Path, rows: int) -> None:
    steps = np.full(20 * rows, 0.002)
    steps[rows - 1 :: rows] = 0.062
    loaded = at_times(tmp_path / 'a.csv', steps)
    assert [len(record) for record in loaded.records] == [rows] * 20
    assert 'gap' in codes(loaded)
    assert 'long_steps' not in codes(loaded)


@pytest.mark.parametrize('rows', [12, 40])
def test_bursts_and_a_heap_of_pieces_stay_one_record_and_are_told(
    tmp_path: Path, rows: int
) -> None:
    """Holes after every dozen rows; rows that are sent and stamped by forty."""
    steps = np.full(20 * rows, 0.002 if rows < 20 else 5e-5)
    steps[rows - 1 :: rows] = 0.062
    loaded = at_times(tmp_path / 'a.csv', steps)
    assert len(loaded.records) == 1
    assert codes(loaded) == {'long_steps'}


def test_time_as_a_date_begins_at_zero(tmp_path: Path) -> None:
    rows = [f'{1.7e9 + 0.01 * k:.3f},1,{k}' for k in range(50)]
    record = load(table(tmp_path / 'a.csv', HEADER, rows)).records[0]
    assert (record.time[0], record.time[-1]) == (0, pytest.approx(0.49, abs=1e-6))
    assert '1700000000' in record.provenance.notes[0]


def offered(error: pytest.ExceptionInfo[UserError], folder: Path) -> Path:
    """Return the msg_config that an error offers."""
    path = folder / 'offered.yaml'
    path.write_text(str(error.value).partition('for example')[2].partition('\n')[2])
    return path


def test_headers_in_another_language_are_offered_by_their_units(tmp_path: Path) -> None:
    rows = [f'{k / 100};{k % 12};1500;60;{k}' for k in range(20)]
    header = 'Zeit [s];Spannung [V];Strom (mA);Drehzahl [1/min];Winkel [°]'
    path = table(tmp_path / 'a.csv', header, [row.replace('.', ',') for row in rows])
    with pytest.raises(UserError, match='understood as a time') as error:
        load(path)
    assert 'COLUMN,' not in str(error.value)
    record = load(path, offered(error, tmp_path)).records[0]
    assert set(record) == {'voltage', 'current', 'speed', 'position'}
    assert record.time[-1] == pytest.approx(0.19)
    assert record['voltage'][3] == 3.0
    assert record['current'] == pytest.approx(1.5)
    assert record['speed'] == pytest.approx(2 * np.pi)
    assert record['position'][9] == pytest.approx(np.deg2rad(9))


def test_what_no_header_says_is_left_to_fill_in(tmp_path: Path) -> None:
    path = table(tmp_path / 'a.csv', 't,qg,vir', ramp())
    with pytest.raises(UserError, match='understood as a signal') as error:
        load(path)
    assert "time: {column: 't', unit: s}" in str(error.value)
    assert 'voltage: {column: COLUMN, unit: V}' in str(error.value)
    with pytest.raises(UserError, match='no column `COLUMN`; its columns are t, qg, vir'):
        load(path, offered(error, tmp_path))
    with pytest.raises(UserError, match=r'time: {column: COLUMN, unit: s}  # or {step: SECONDS}'):
        load(table(tmp_path / 'b.csv', 'qg,vir', ['1,2', '2,3']))


def dates(count: int = 50) -> list[str]:
    return [f'2025-03-01T10:00:{0.02 * k:06.3f},{k % 12},{k}' for k in range(count)]


def test_dates_need_no_msg_config_where_the_header_says_time(tmp_path: Path) -> None:
    loaded = load(table(tmp_path / 'a.csv', 'time,voltage [V],speed [rad/s]', dates()))
    assert loaded.records[0].time == pytest.approx(0.02 * np.arange(50))
    assert loaded.findings == ()


@pytest.mark.parametrize('head', ['time [s]', 'Zeit'])
def test_dates_under_another_header_are_told_how_to_read(tmp_path: Path, head: str) -> None:
    path = table(tmp_path / 'a.csv', f'{head},voltage [V],speed [rad/s]', dates())
    with pytest.raises(UserError) as error:
        load(path)
    line = f"time: {{column: '{head}', unit: iso8601}}"
    assert line in str(error.value)
    config = tmp_path / 'a.yaml'
    config.write_text(f"{line}\nsignals: {{speed: {{column: 'speed [rad/s]'}}}}")
    assert load(path, config).records[0].time == pytest.approx(0.02 * np.arange(50))


def test_wrapped_angle_is_made_continuous(tmp_path: Path) -> None:
    rows = [f'{0.01 * k:.3f},1,{(7 * k) % 360}' for k in range(200)]
    path = table(tmp_path / 'a.csv', 'time [s],voltage [V],position [deg]', rows)
    record = load(path).records[0]
    assert np.diff(record['position']) == pytest.approx(np.deg2rad(7))


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('', 'is empty'),
        ('\n\n# nothing\n', 'is empty'),
        (HEADER + '\n', r'a header \(time .* but no rows'),
        ('0,1,2\n1,2,3\n', 'no header line'),
        ('a,b,c\n0,1,2\n', r'no column is understood as a time.*a, b, c'),
        ('t_s,q_ref_m,q_m,u_V\n0,1,2,3\n', r"(?s)understood as a signal.*voltage: {column: 'u_V'"),
        ('t,ref_rpm,meas_rpm,pwm\n0,1,2,3\n', r"(?s)speed: {column: 'meas_rpm'.*voltage: {"),
        (
            'ms_today;input_voltage;q_axis_current;erpm\n0;1;2;3\n',
            r'understood as a time.*`--msg-config vesc` reads them.*VESC Tool',
        ),
        ('time [s],speed [rpm],speed [rad/s]\n0,1,2\n', 'both mean speed'),
        ('time [s],speed [V]\n0,1\n', r'`speed` is given in `V`'),
        ('time [s],speed [furlong]\n0,1\n', r'column `speed \[furlong\]`: unit `furlong`'),
        ('time [V],speed [rad/s]\n0,1\n', 'no time'),
        (HEADER + '\n0,1,2\n', 'no two complete samples'),
        (HEADER + '\nnan,1,2\nnan,1,2\n', 'no two complete samples'),
        ('time [s],speed [rad/s],speed [rad/s]\n0,1,1\n', 'both mean speed'),
        ('\0\0\0binary', 'not a text file'),
    ],
)
def test_what_cannot_be_read(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / 'a.csv'
    path.write_text(text)
    with pytest.raises(UserError, match=message):
        load(path)


def test_broken_gzip(tmp_path: Path) -> None:
    whole = gzip.compress('\n'.join([HEADER, *ramp(5000)]).encode())
    path = tmp_path / 'a.csv.gz'
    path.write_bytes(whole[: len(whole) // 2])
    loaded = load(path)
    assert 1000 < len(loaded.records[0]) < 5000
    assert 'damaged_file' in codes(loaded)
    path.write_bytes(whole[:10] + b'not a stream at all')
    with pytest.raises(UserError, match='damaged gzip'):
        load(path)
    path.write_bytes(whole + whole[len(whole) :])
    assert len(load(path).records[0]) == 5000


def test_600_000_rows_open_fast(tmp_path: Path) -> None:
    record = motor_record(2000)
    body = (tmp_path / 'small.csv', tmp_path / 'big.csv')
    write_record(record, body[0])
    header, *rows = body[0].read_text().splitlines()
    tail = [row.partition(',')[2] for row in rows]
    rows = [f'{k / 1000},{tail[k % 2000]}' for k in range(600_000)]
    table(body[1], header, rows)
    begin = time.process_time()
    loaded = load(body[1])
    assert time.process_time() - begin < 3  # 0.5 s on a free core
    assert len(loaded.records[0]) == 600_000


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=150)
@given(st.text(alphabet='0123456789.,;-+eE \n\t"#naifx[]/_tspedvolgrcurn', max_size=300))
def test_any_text_gives_a_record_or_a_user_error(tmp_path: Path, text: str) -> None:
    path = tmp_path / 'any.csv'
    path.write_text('time [s],speed [rad/s]\n' + text)
    try:
        loaded = load(path)
    except UserError:
        return
    assert loaded.records
    found = read_table(path)
    for name in found.names:
        assert len(found.texts(name)) == found.numbers([name])[name].size


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=100)
@given(st.lists(st.one_of(st.floats(), st.just(0.5)), min_size=1, max_size=40))
def test_any_times_give_records_or_a_user_error(tmp_path: Path, times: list[float]) -> None:
    path = table(tmp_path / 'any.csv', 'time [s],speed [rad/s]', [f'{t},{t}' for t in times])
    try:
        loaded = load(path)
    except UserError:
        return
    assert sum(map(len, loaded.records)) <= len(times)


def test_duty_times_supply_is_the_voltage_where_none_is_recorded(tmp_path):
    path = tmp_path / 'servo.csv'
    rows = ''.join(f'{0.01 * k},{0.001 * k},{10 + 0.01 * k},{k}\n' for k in range(50))
    path.write_text('time [s],duty [1],supply_voltage [V],speed [rad/s]\n' + rows)
    loaded = load(path)
    (record,) = loaded.records
    np.testing.assert_allclose(record['voltage'], record['duty'] * record['supply_voltage'])
    assert loaded.origins['voltage'] == 'duty * supply_voltage'
    assert [f.code for f in loaded.findings] == ['voltage_computed']

    path.write_text('time [s],duty [1],supply_voltage [V],voltage [V],speed [rad/s]\n' + ''.join(
        f'{0.01 * k},{0.001 * k},{10 + 0.01 * k},{k},{k}\n' for k in range(50)
    ))  # fmt: skip
    (record,) = load(path).records
    np.testing.assert_allclose(record['voltage'], np.arange(50.0))


def test_a_model_in_place_of_a_recording_is_told(tmp_path: Path) -> None:
    path = tmp_path / 'model.yaml'
    path.write_text('motor: brushed_dc\n')
    with pytest.raises(UserError, match=r'is no recording \(models are .yaml.*`--model`'):
        load(path)
