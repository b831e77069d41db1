"""`motor-sysid check` and the command line around it: words, exit codes, JSON, no tracebacks."""

import argparse
from dataclasses import replace
import importlib.util
import json
import os
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest
from recording_tools import motor_record, motor_topics, write_bag

from motor_sysid import __version__
from motor_sysid.cli import main, VERBS
from motor_sysid.cli.common import add_data_arguments
from motor_sysid.cli.reading import load_data
from motor_sysid.errors import UserError
from motor_sysid.physics.datasheet import load_datasheet
from motor_sysid.recording.save import write_record

RPM = 60 / (2 * np.pi)


@pytest.fixture
def good(tmp_path: Path) -> Path:
    write_record(motor_record(6000), tmp_path / 'good.csv.gz')
    return tmp_path / 'good.csv.gz'


@pytest.fixture
def in_rpm(tmp_path: Path) -> Path:
    record = motor_record(6000)
    write_record(record.with_signal('speed', record['speed'] * RPM, 'rad/s'), tmp_path / 'rpm.csv')
    return tmp_path / 'rpm.csv'


def test_good_data(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['check', str(good)]) == 0
    text = capsys.readouterr().out
    assert 'usable: nothing to complain about' in text
    assert 'speed [rad/s]' in text
    assert '6000 samples' in text


def test_bad_data_in_words_and_json(
    in_rpm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'check.json'
    assert main(['check', str(in_rpm), '--json', str(file), '--quiet']) == 2
    text = capsys.readouterr().out
    assert 'error    speed_unit: speed seems to be in rpm' in text
    assert 'not usable as it is: 1 error, 0 warnings' in text
    assert 'rate:' not in text
    document = json.loads(file.read_text())
    assert document['schema'] == 'motor_sysid/check/1'
    (data,) = document['data']
    assert data['usable'] is False
    assert data['signals']['speed'] == {'unit': 'rad/s', 'from': 'speed [rad/s]'}
    assert data['records'][0]['samples'] == 6000
    finding = next(f for f in data['findings'] if f['code'] == 'speed_unit')
    assert set(finding) == {
        'severity', 'code', 'message', 'consequence', 'remedy', 'numbers'
    }  # fmt: skip


def test_mended_through_a_msg_config(in_rpm: Path, tmp_path: Path) -> None:
    config = tmp_path / 'mine.yaml'
    config.write_text(
        'time: time [s]\nsignals:\n'
        "  voltage: {column: 'voltage [V]'}\n"
        "  speed: {column: 'speed [rad/s]', unit: rpm}\n"
        "  position: {column: 'position [rad]'}\n"
    )
    assert main(['check', str(in_rpm), '--msg-config', str(config)]) == 0


def test_several_data_and_a_data_sheet(good: Path, tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag', motor_topics(motor_record(600)))
    assert main(['check', str(good), str(bag)]) == 0
    record = motor_record(6000).select(['voltage', 'current', 'speed'])
    file = tmp_path / 'a.csv'
    write_record(record.with_signal('speed', record['speed'] * RPM, 'rad/s'), file)
    sheet = tmp_path / 'sheet.yaml'
    sheet.write_text('nominal: {torque_constant_Nm_per_A: 0.05}')
    assert main(['check', str(file)]) == 0
    assert main(['check', str(file), '--nominal', str(sheet)]) == 2


@pytest.mark.parametrize(
    ('name', 'content', 'message'),
    [
        ('a.csv', '', 'is empty'),
        ('a.csv', 'time [s],speed [rad/s]\n0,a\n1,b\n', 'is not a number'),
        ('a.csv', 'x,y\n1,2\n', 'no column is understood'),
        ('a.mcap', '', 'is empty'),
        ('a.mcap', 'text', 'not an MCAP file'),
        ('a.db3', 'text', 'not a sqlite3 database'),
        ('missing.csv', None, 'does not exist'),
    ],
)
def test_unreadable_data(
    tmp_path: Path, name: str, content: str | None, message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    if content is not None:
        (tmp_path / name).write_text(content)
    assert main(['check', str(tmp_path / name)]) == 2
    error = capsys.readouterr().err
    assert error.startswith('error: ')
    assert message in error


def test_every_verb_refuses_data_that_would_mislead(in_rpm: Path, good: Path) -> None:
    assert len(load_data([good], None)) == 1
    with pytest.raises(UserError, match=r'rpm\.csv cannot be used .*\n  speed seems to be in rpm'):
        load_data([in_rpm], None)


def test_every_verb_exists() -> None:
    missing = [v for v in VERBS if importlib.util.find_spec(f'motor_sysid.cli.{v}') is None]
    assert missing == []


@pytest.mark.parametrize('verb', VERBS)
def test_every_verb_explains_itself(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main([verb, '--help'])
    assert end.value.code == 0
    assert len(capsys.readouterr().out.splitlines()) > 5


def test_usage_errors(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in ([], ['chek'], ['check'], ['check', 'a', '--nonsense']):
        with pytest.raises(SystemExit) as end:
            main(arguments)
        assert end.value.code == 2
    assert 'usage: motor-sysid' in capsys.readouterr().err


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, '-m', 'motor_sysid.cli', *arguments],
        capture_output=True, text=True, timeout=60, check=False,
        cwd=Path(__file__).parent.parent,
    )  # fmt: skip


def test_as_a_process(good: Path) -> None:
    assert run('--version').stdout == f'motor-sysid {__version__}\n'
    assert 'check' in run('--help').stdout
    assert run('check', str(good)).returncode == 0
    broken = run('check', '/nowhere')
    assert (broken.returncode, broken.stdout) == (2, '')
    assert 'Traceback' not in broken.stderr


def test_a_reader_that_leaves(good: Path) -> None:
    command = f'{sys.executable} -m motor_sysid.cli check {good} | head -c 10'
    done = subprocess.run(
        command, shell=True, capture_output=True, text=True, check=False,
        cwd=Path(__file__).parent.parent,
    )  # fmt: skip
    assert 'Traceback' not in done.stderr


def test_tables_on_a_terminal(good: Path, monkeypatch: pytest.MonkeyPatch,
                              capsys: pytest.CaptureFixture[str]) -> None:  # fmt: skip
    pytest.importorskip('rich')
    monkeypatch.setenv('FORCE_COLOR', '1')
    monkeypatch.setenv('COLUMNS', '140')
    assert main(['check', str(good)]) == 0
    text = capsys.readouterr().out
    assert 'what to do' in text
    assert 'speed [rad/s]' in text


def test_an_option_that_is_given_twice_keeps_both(tmp_path):
    first, second = tmp_path / 'a.csv', tmp_path / 'b.csv'
    parser = argparse.ArgumentParser()
    add_data_arguments(parser, validate=True)
    for given in (['--validate', first, '--validate', second], ['--validate', first, second]):
        args = parser.parse_args(['train.csv', *map(str, given)])
        assert args.validate == [first, second]
    assert parser.parse_args(['train.csv']).validate == []


def test_a_data_sheet_of_which_nothing_is_understood_is_refused(tmp_path):
    sheet = tmp_path / 'sheet.yaml'
    sheet.write_text('values: {J: 1e-4}\n')
    with pytest.raises(UserError, match=r'understood \(values\).*inertia_total_kgm2'):
        load_datasheet(sheet)
    sheet.write_text('nominal: {inertia_total_kgm2: 1.0e-4}\nprice: 30\n')
    assert load_datasheet(sheet).nominal == {'J': 1e-4}


def test_steps_that_no_recording_has_are_refused_with_the_unit_of_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], recwarn: pytest.WarningsRecorder
) -> None:
    record = motor_record(2000)
    for size in (1e-300, 1e-8, 1e8, 1e300):
        odd = replace(record, time=record.time * (size / record.time[-1]))
        write_record(odd, tmp_path / 'odd.csv')
        assert main(['check', str(tmp_path / 'odd.csv')]) == 2
        assert 's apart are outside 1e-09 to 10000 s' in capsys.readouterr().out
        assert main(['fit', str(tmp_path / 'odd.csv')]) == 2
        assert 'give the unit of the time: `time [ms]`' in capsys.readouterr().err
    assert not recwarn.list


def test_a_terminal_that_lacks_a_character_shows_a_question_mark(good: Path) -> None:
    umlaut = good.rename(good.with_name('güte.csv.gz'))
    done = subprocess.run(
        [sys.executable, '-m', 'motor_sysid.cli', 'check', str(umlaut)],
        env={**os.environ, 'PYTHONIOENCODING': 'ascii'}, capture_output=True, text=True,
        timeout=60, check=False, cwd=Path(__file__).parent.parent,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, '')
    assert 'te.csv.gz' in done.stdout
    assert '?' in done.stdout.splitlines()[0]
