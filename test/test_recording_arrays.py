"""MATLAB and numpy files are read as tables; what is no column is said, what is broken refused."""

import numpy as np
import pytest
from scipy.io import savemat

from motor_sysid.cli import main
from motor_sysid.errors import UserError
from motor_sysid.recording import load
from motor_sysid.recording.msg_config import parse_msg_config

STEP = 1e-3
TIME = STEP * np.arange(2000)
VOLTAGE = np.sin(5.0 * TIME)
STRUCTURE = {
    'time': {'step': 1, 'unit': 'ms'},
    'signals': {
        'voltage': {'column': 'data.u', 'unit': 'V'},
        'speed': {'column': 'data.y[1]', 'unit': 'rpm'},
    },
}


def test_a_matlab_structure_without_time_becomes_a_record(tmp_path):
    path = tmp_path / 'run.mat'
    outputs = np.column_stack([VOLTAGE, 30.0 * VOLTAGE])
    savemat(path, {'data': {'u': VOLTAGE[:, None], 'y': outputs}, 'Ts': STEP})

    loaded = load(path, parse_msg_config(STRUCTURE))

    (record,) = loaded.records
    np.testing.assert_allclose(record.time, TIME, atol=1e-12)
    np.testing.assert_array_equal(record['voltage'], VOLTAGE)
    np.testing.assert_allclose(record['speed'], np.pi * VOLTAGE)
    assert any('no column: Ts' in finding.message for finding in loaded.findings)


def test_cells_are_left_out_however_ragged(tmp_path):
    path = tmp_path / 'RUN.MAT'
    cells = np.empty(2, dtype=object)
    cells[:] = [VOLTAGE, VOLTAGE[:7]]
    savemat(path, {'time': TIME, 'voltage': VOLTAGE, 'speed': VOLTAGE, 'runs': cells},
            appendmat=False)  # fmt: skip
    loaded = load(path)
    assert loaded.records[0].time.size == TIME.size
    assert any('no column: runs' in finding.message for finding in loaded.findings)


def test_matrices_that_lie_on_their_side_are_turned(tmp_path):
    path = tmp_path / 'run.mat'
    savemat(path, {'data': {'u': VOLTAGE, 'y': np.vstack([VOLTAGE, VOLTAGE])}})
    (record,) = load(path, parse_msg_config(STRUCTURE)).records
    assert record.time.size == TIME.size


def test_a_numpy_file_needs_no_config(tmp_path):
    path = tmp_path / 'run.npz'
    objects = np.array([{}, {}], dtype=object)
    np.savez(path, time_s=TIME, voltage_v=VOLTAGE, speed_rad_s=2.0 * VOLTAGE, notes=objects)

    loaded = load(path)

    (record,) = loaded.records
    np.testing.assert_array_equal(record['speed'], 2.0 * VOLTAGE)
    assert any('no column: notes' in finding.message for finding in loaded.findings)


def test_lengths_that_differ_are_told(tmp_path):
    path = tmp_path / 'run.npz'
    np.savez(path, time=TIME, voltage=VOLTAGE[:-5], speed=VOLTAGE)
    with pytest.raises(UserError, match='`time` 2000, `voltage` 1995'):
        load(path)


def test_a_column_that_names_segments_is_as_long_as_the_others(tmp_path):
    path = tmp_path / 'run.npz'
    np.savez(path, t=TIME, u=VOLTAGE, y=VOLTAGE, test=np.repeat([1, 2], 500), part=TIME > 1)
    signals = {'voltage': {'column': 'u'}, 'speed': {'column': 'y'}}
    config = {'time': 't', 'segment_by': 'part', 'signals': signals}
    assert len(load(path, parse_msg_config(config)).records) == 2
    with pytest.raises(UserError, match='column `test` has 1000 values, the others 2000'):
        load(path, parse_msg_config({**config, 'segment_by': 'test'}))


def test_numbers_are_no_dates(tmp_path):
    path = tmp_path / 'run.npz'
    np.savez(path, t=TIME, y=VOLTAGE)
    time = {'column': 't', 'unit': 'iso8601'}
    config = {'time': time, 'signals': {'speed': {'column': 'y'}}}
    with pytest.raises(UserError, match='column `t` holds numbers, no dates; give the unit'):
        load(path, parse_msg_config(config))


def test_a_missing_column_is_named(tmp_path):
    path = tmp_path / 'run.npz'
    np.savez(path, u=VOLTAGE, y=VOLTAGE)
    with pytest.raises(UserError, match=r'no column `data\.u`; its columns are u, y'):
        load(path, parse_msg_config(STRUCTURE))


@pytest.mark.parametrize(
    ('name', 'content', 'says'),
    [
        ('a.mat', b'', 'cannot be read as a MATLAB file'),
        ('a.mat', b'hello' * 99, 'cannot be read as a MATLAB file'),
        ('a.mat', b'MATLAB 7.3'.ljust(512) + b'\x89HDF\r\n\x1a\n', '-v7'),
        ('a.npz', b'hello' * 99, 'no .npz file'),
    ],
)
def test_files_that_cannot_be_read_are_refused_with_a_remedy(tmp_path, name, content, says):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(UserError, match=says):
        load(path)


@pytest.mark.parametrize('share', [0.1, 0.5, 0.9])
def test_a_file_that_is_cut_off_is_refused(tmp_path, share):
    for name, write in (
        ('a.mat', lambda path: savemat(path, {'u': VOLTAGE}, do_compression=True)),
        ('b.mat', lambda path: savemat(path, {'u': VOLTAGE})),
        ('c.npz', lambda path: np.savez(path, u=VOLTAGE)),
    ):
        path = tmp_path / name
        write(path)
        whole = path.read_bytes()
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(UserError, match=r'[aebc]\.(mat|npz)'):
            load(path)


def test_a_file_without_columns_says_what_it_holds(tmp_path):
    path = tmp_path / 'run.mat'
    savemat(path, {'Ts': STEP, 'name': 'motor'})
    with pytest.raises(UserError, match='no column of two or more numbers; it holds Ts, name'):
        load(path)


@pytest.mark.parametrize(
    ('time', 'says'),
    [
        ({'step': 0}, 'above 0'),
        ({'step': 0, 'column': 't'}, 'of a count of the column'),
        ({'unit': 's'}, 'or `step: SECONDS`'),
        ({'step': 1, 'unit': 'iso8601'}, 'above 0'),
        ({'step': 1, 'unit': 'V'}, 'must be a time'),
    ],
)
def test_a_step_is_a_time(time, says):
    with pytest.raises(UserError, match=says):
        parse_msg_config(STRUCTURE | {'time': time})


def test_a_column_of_ticks_takes_what_one_lasts(tmp_path):
    (tmp_path / 'run.csv').write_text('tick,u\n' + ''.join(f'{25 * k},{k}\n' for k in range(9)))
    time = {'column': 'tick', 'step': 10, 'unit': 'us'}
    config = parse_msg_config({'time': time, 'signals': {'voltage': {'column': 'u'}}})
    (record,) = load(tmp_path / 'run.csv', config).records
    np.testing.assert_allclose(record.time, 250e-6 * np.arange(9))


def test_a_csv_without_time_takes_a_step(tmp_path, capsys):
    data, config = tmp_path / 'run.csv', tmp_path / 'run.yaml'
    data.write_text('u,y\n' + ''.join(f'{u},{2 * u}\n' for u in VOLTAGE))
    config.write_text(
        'time: {step: 0.001}\n'
        'signals: {voltage: {column: u, unit: V}, speed: {column: y, unit: rad/s}}\n'
    )
    assert main(['check', str(data), '--msg-config', str(config)]) == 0
    assert '1.999 s at 1000 Hz' in capsys.readouterr().out
