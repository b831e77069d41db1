"""What verbs write: tried before the work, all that can be, JSON that any reader takes, pipes."""

import json
import math
from pathlib import Path
import socket
import subprocess
import sys

import pytest
from recording_tools import motor_record

from motor_sysid.cli import main
from motor_sysid.cli.output import write_each, write_json
from motor_sysid.diagnosis.calibration.store import save_calibration
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.physics.store import load_model, save_model
from motor_sysid.recording.save import write_record

ROOT = Path(__file__).parent.parent
WRITING = (
    ['fit', 'none.csv', '-o'],
    ['fit', 'none.csv', '--json'],
    ['diagnose', 'none.csv', '-o'],
    ['diagnose', 'none.csv', '--json'],
    ['diagnose', 'none.csv', '--report'],
    ['learn', 'none.csv', '-o'],
    ['add', 'm.yaml', 'coulomb_friction', 'none.csv', '-o'],
    ['suggest', 'm.yaml', 'none.csv', '-o'],
    ['compare', 'm.yaml', 'none.csv', '--json'],
    ['monitor', 'm.yaml', 'none.csv', '--json'],
    ['report', 'found.json', '-o'],
    ['replay', 'bag', '--csv'],
    ['calibrate', 'none.csv', '-o'],
    ['check', 'none.csv', '--json'],
    ['benchmark', 'diagnosis', '--page'],
    ['simulate', '-o', 'run.csv', '--save-model'],
)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    write_record(motor_record(2000), tmp_path / 'a.csv')
    return tmp_path / 'a.csv'


def error_of(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Return what is said where a verb ends with exit code 2."""
    assert main([str(argument) for argument in arguments]) == 2
    return capsys.readouterr().err


@pytest.mark.parametrize('call', WRITING, ids=' '.join)
def test_a_folder_is_no_file_and_that_is_said_before_the_work(
    call: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert error_of(capsys, *call, '.') == (
        'error: cannot write .: it is a folder; name a file in it\n'
    )


@pytest.mark.parametrize('call', [c for c in WRITING if c[0] not in ('report', 'calibrate')
                                  and c[-1] != '--report'], ids=' '.join)  # fmt: skip
def test_a_folder_that_is_not_there_is_told_before_the_work(
    call: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    error = error_of(capsys, *call, tmp_path / 'none' / 'file')
    assert f'there is no folder {tmp_path / "none"}; make it first' in error


def test_pages_make_their_folder_but_not_in_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'file'
    file.touch()
    error = error_of(capsys, 'diagnose', 'none.csv', '--report', file / 'deep' / 'page.html')
    assert f'{file} is no folder' in error
    error = error_of(capsys, 'diagnose', 'none.csv', '--report', tmp_path / 'deep' / 'page.html')
    assert 'none.csv does not exist' in error


def test_no_store_takes_a_folder_for_a_file(tmp_path: Path) -> None:
    for folder in (Path(), tmp_path):
        with pytest.raises(UserError, match='is a folder'):
            save_model(Model.base('brushed_dc'), folder)
        with pytest.raises(UserError, match='is a folder'):
            save_calibration(None, folder)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_does_not_cost_the_rest(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, page = data.parent / 'm.yaml', data.parent / 'page.html'
    few = ['--effects', 'coulomb_friction', '--max-effects', '0']
    error = error_of(
        capsys, 'diagnose', data, *few, '--json', '/dev/full', '-o', model, '--report', page
    )
    assert 'error: cannot write /dev/full: No space left' in error
    assert load_model(model).motor == 'brushed_dc'
    assert '<html' in page.read_text(encoding='utf-8')


def test_all_that_went_wrong_is_told() -> None:
    done = []

    def fails(text: str) -> None:
        raise UserError(text)

    with pytest.raises(UserError, match='no a; no b'):
        write_each(lambda: fails('no a'), lambda: done.append(1), lambda: fails('no b'))
    assert done == [1]


def test_numbers_that_are_not_finite_become_null(tmp_path: Path) -> None:
    write_json({'a': [math.inf, 1.5, (math.nan,)], 'b': {'c': -math.inf}}, tmp_path / 'x.json')
    text = (tmp_path / 'x.json').read_text()
    assert json.loads(text) == {'a': [None, 1.5, [None]], 'b': {'c': None}}


def test_a_port_is_looked_at_before_the_diagnosis(capsys: pytest.CaptureFixture[str]) -> None:
    for port in ('99999', '-1', 'http'):
        error = error_of(capsys, 'workbench', 'none.csv', f'--port={port}')
        assert f'--port {port} is no whole number from 0 to 65535' in error
    with socket.create_server(('127.0.0.1', 0)) as taken:
        port = taken.getsockname()[1]
        error = error_of(capsys, 'workbench', 'none.csv', '--port', port)
    assert f'cannot serve on port {port}: Address already in use' in error


def test_json_to_a_pipe(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for call in (['check', data], ['fit', data], ['check', data, data]):
        assert main([*map(str, call), '--json', '-']) == 0
        said = capsys.readouterr()
        assert json.loads(said.out)['schema'] == f'motor_sysid/{call[0]}/1'
        assert 'error' in said.err or 'usable' in said.err
    assert not Path('-').exists()


def run(command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command.replace('motor-sysid', f'{sys.executable} -m motor_sysid.cli'),
        shell=True, capture_output=True, text=True, timeout=60, check=False, cwd=ROOT,
    )  # fmt: skip


def test_a_full_disk_behind_stdout(data: Path) -> None:
    done = run(f'motor-sysid check {data} > /dev/full')
    assert done.returncode == 2
    assert done.stderr == 'error: No space left on device; make room and try again\n'
