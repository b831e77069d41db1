"""Files that are written whole, where users' folders are, and what a verb says of both."""

import json
import os
from pathlib import Path
import stat
from types import SimpleNamespace

import numpy as np
import pytest
from recording_tools import motor_record

from motor_sysid import user_folders
from motor_sysid.cli import benchmark, main, monitor, reading, replay, report
from motor_sysid.cli.diagnose import usual_settings
from motor_sysid.diagnosis.calibration.store import calibration_folder
from motor_sysid.machine_code import cache_directory
from motor_sysid.recording.save import write_record
from motor_sysid.user_folders import user_folder
from motor_sysid.whole_file import write_whole


def test_a_link_stays_one_and_what_it_leads_to_is_written(tmp_path: Path) -> None:
    real, link = tmp_path / 'real.yaml', tmp_path / 'link.yaml'
    real.write_text('old')
    real.chmod(0o640)
    link.symlink_to(real)
    write_whole(link, 'new')
    assert link.is_symlink()
    assert real.read_text() == 'new'
    assert stat.S_IMODE(real.stat().st_mode) == 0o640
    assert [*tmp_path.iterdir()].count(real) == 1
    assert not [one for one in tmp_path.iterdir() if one.name.endswith('.part')]


def test_what_is_no_file_is_written_to_and_stays_what_it_is(tmp_path: Path) -> None:
    pipe = tmp_path / 'pipe'
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_whole(pipe, 'all of it')
        assert os.read(reader, 100) == b'all of it'
    finally:
        os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_what_cannot_be_written_leaves_what_was_there_and_no_part(tmp_path: Path) -> None:
    target = tmp_path / 'a.txt'
    target.write_text('old')
    with pytest.raises(UnicodeEncodeError):
        write_whole(target, '\ud800')
    assert target.read_text() == 'old'
    assert [*tmp_path.iterdir()] == [target]


def test_who_has_no_home_has_folders_that_nobody_else_can_write_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nowhere() -> Path:
        raise RuntimeError('Could not determine home directory.')

    for name in ('XDG_CACHE_HOME', 'MOTOR_SYSID_CACHE', 'MOTOR_SYSID_CALIBRATION'):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.delenv('XDG_CONFIG_HOME', raising=False)
    monkeypatch.setattr(user_folders.Path, 'home', nowhere)
    monkeypatch.setattr(user_folders.tempfile, 'tempdir', str(tmp_path))
    found = cache_directory()
    own = tmp_path / f'motor_sysid-{os.getuid()}'
    assert found == own / '.cache' / 'motor_sysid'
    assert stat.S_IMODE(own.stat().st_mode) == 0o700
    assert calibration_folder() == own / '.config' / 'motor_sysid' / 'calibration'
    own.chmod(0o777)
    assert own not in cache_directory().parents
    monkeypatch.setenv('XDG_CACHE_HOME', '/there')
    assert user_folder('XDG_CACHE_HOME', '.cache') == Path('/there/motor_sysid')


def test_a_table_of_estimates_has_a_place_for_every_parameter_that_there_ever_was(
    tmp_path: Path,
) -> None:
    def event(second: int, **values: tuple[float, str]) -> SimpleNamespace:
        found = {name: (value, 0.1, unit, True) for name, (value, unit) in values.items()}
        return SimpleNamespace(stamp=second * 10**9, estimate=found)

    events = [event(1, R=(1.0, 'ohm'), tau_c=(0.012, 'N m')), event(2, R=(1.5, 'ohm')),
              event(3, R=(1.5, 'ohm'), k_d=(3e-7, 'N m s^2/rad^2'))]  # fmt: skip
    replay._write_csv(SimpleNamespace(estimates=events), tmp_path / 'e.csv')
    head, *rows = (tmp_path / 'e.csv').read_text().splitlines()
    names = [cell.split()[0] for cell in head.split(',')]
    assert names == ['time', 'R', 'R_sigma', 'tau_c', 'tau_c_sigma', 'k_d', 'k_d_sigma']
    cells = [dict(zip(names, row.split(','), strict=True)) for row in rows]
    assert [one['tau_c'] for one in cells] == ['0.012', '', '']
    assert [one['k_d'] for one in cells] == ['', '', '3e-07']
    assert [one['R'] for one in cells] == ['1.0', '1.5', '1.5']


def test_what_the_system_refuses_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def locked(*args: object) -> None:
        raise PermissionError(13, 'Permission denied', 'locked/a.csv')

    monkeypatch.setattr(reading, 'load_data', locked)
    monkeypatch.setattr('motor_sysid.recording.load', locked)
    assert main(['check', 'locked/a.csv']) == 2
    assert capsys.readouterr().err == 'error: locked/a.csv: Permission denied\n'
    assert main(['check', 'x' * 300]) == 2


def test_a_case_of_a_benchmark_is_written_as_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    result = SimpleNamespace(as_dict=lambda: {'case': 'complete/1'})
    monkeypatch.setattr('motor_sysid.benchmark.diagnosis.one', lambda task: result)
    call = ['benchmark', 'diagnosis', '--case', 'complete/1', '--no-peers']
    assert main([*call, '--json', str(tmp_path / 'c.json')]) == 0
    assert json.loads((tmp_path / 'c.json').read_text()) == [{'case': 'complete/1'}]
    capsys.readouterr()
    assert main([*call, '--page', str(tmp_path / 'c.html')]) == 2
    assert '--page shows many cases' in capsys.readouterr().err
    assert benchmark.HELP


def test_days_are_called_by_what_tells_them_apart(tmp_path: Path) -> None:
    days = [Path('d1/run.csv'), Path('d2/run.csv')]
    drift = SimpleNamespace(parameters=())
    found = [SimpleNamespace(drift=drift, words=f'word {k}', causes=(), moved=()) for k in (1, 2)]
    reference = SimpleNamespace(parameters=SimpleNamespace(free=()))
    lines = monitor._lines(reference, days, found)
    assert {'d1/run.csv: word 1', 'd2/run.csv: word 2'} <= set(lines)


def test_of_several_recordings_the_one_at_fault_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good = motor_record(2000)
    write_record(good, tmp_path / 'good.csv')
    against = good.with_signal('current', -np.asarray(good['current']), 'A')
    write_record(against, tmp_path / 'against.csv')
    paths = [str(tmp_path / name) for name in ('good.csv', 'against.csv')]
    assert main(['fit', *paths, '--motor', 'brushed_dc']) == 2
    said = capsys.readouterr().err
    assert f'error: {paths[1]} cannot be used' in said
    assert f'{paths[0]} cannot' not in said


def test_a_report_asks_of_evidence_what_a_diagnosis_asks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = {}

    def diagnose(train: object, held: object, **given: object) -> object:
        asked.update(given)
        raise KeyboardInterrupt

    monkeypatch.setattr('motor_sysid.diagnosis.diagnose', diagnose)
    monkeypatch.setattr('motor_sysid.physics.store.load_model', lambda path: None)
    monkeypatch.setattr(report, 'load_both', lambda *given: ([], []))
    monkeypatch.setattr(
        'motor_sysid.diagnosis.calibration.store.load_calibrations', lambda complain: ['told']
    )
    assert main(['report', 'm.yaml', 'a.csv', '-o', str(tmp_path / 'r.html')]) == 130
    assert asked['settings'] == usual_settings()
    assert asked['settings'].calibrations == ('told',)
