"""Options that make no sense, alone or beside others, and files that are not there, in words."""

from pathlib import Path

import pytest
from recording_tools import motor_record

from motor_sysid.cli import main
from motor_sysid.recording.save import write_record

FITTING = (['fit'], ['diagnose'], ['learn'], ['calibrate'], ['add', 'm.yaml', 'coulomb_friction'])


@pytest.fixture
def data(tmp_path: Path) -> Path:
    write_record(motor_record(400), tmp_path / 'a.csv')
    return tmp_path / 'a.csv'


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Return what is said of arguments that are refused."""
    assert main([str(argument) for argument in arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith('error: ')
    return error


@pytest.mark.parametrize('value', ['0', '1', '1.5', '-0.1', 'nan', 'inf', 'half'])
@pytest.mark.parametrize('verb', [*FITTING, ['compare', 'm.yaml']], ids=' '.join)
def test_what_no_part_can_be_is_no_part_to_hold_back(
    verb: list[str], value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    error = refused(capsys, *verb, 'none.csv', f'--hold-back={value}')
    assert f'--hold-back {value} is no number above 0 and below 1' in error


@pytest.mark.parametrize(
    ('value', 'kept'), [('0.9999', 0), ('0.96', 16), ('0.001', 400), ('0.003', 399)]
)
@pytest.mark.parametrize('verb', FITTING, ids=' '.join)
def test_something_must_be_left_to_fit_and_to_judge_on(
    verb: list[str], value: str, kept: int, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if verb[0] == 'add':
        assert main(['simulate', '--duration', '1', '--save-model', str(data.parent / 'm.yaml'),
                     '-o', str(data.parent / 'b.csv')]) == 0  # fmt: skip
        verb = ['add', str(data.parent / 'm.yaml'), 'coulomb_friction']
        capsys.readouterr()
    error = refused(capsys, *verb, data, '--hold-back', value)
    assert f'--hold-back {value} leaves {kept} samples to fit and {400 - kept} to judge' in error


def test_nothing_is_held_back_where_there_is_something_to_judge_on(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = data.with_name('b.csv')
    write_record(motor_record(300), other)
    assert main(['fit', str(data), '--validate', str(other), '--hold-back', '0.9999']) == 0
    assert 'held out' in capsys.readouterr().out


@pytest.mark.parametrize('value', ['-1', '1.5', 'all'])
def test_most_effects_are_a_whole_number(value: str, capsys: pytest.CaptureFixture[str]) -> None:
    error = refused(capsys, 'diagnose', 'none.csv', f'--max-effects={value}')
    assert f'--max-effects {value} is no whole number from 0 on' in error


def test_no_effects_at_all_may_be_added(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    few = ['--max-effects', '0', '--effects', 'coulomb_friction']
    assert main(['diagnose', str(data), *few]) == 0
    assert 'Verdict' in capsys.readouterr().out


@pytest.mark.parametrize('verb', ['fit', 'diagnose', 'learn', 'calibrate', 'workbench'])
def test_a_model_names_its_motor(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    error = refused(capsys, verb, 'none.csv', '--model', 'm.yaml', '--motor', 'pmsm')
    assert '--model names the motor already; leave --motor out' in error


@pytest.mark.parametrize('name', ['nosuch.mcap', 'nosuch'])
def test_a_bag_that_is_not_there(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert f'{name} does not exist' in refused(capsys, 'replay', name)


@pytest.mark.parametrize('option', ['--csv', '--json'])
def test_what_a_replay_cannot_write(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag, model, file = tmp_path / 'bag', tmp_path / 'm.yaml', tmp_path / 'none' / 'file'
    motion = ['--duration', '3', '--profile', 'reversals', '--save-model', str(model)]
    assert main(['simulate', *motion, '-o', str(bag)]) == 0
    capsys.readouterr()
    error = refused(capsys, 'replay', bag, '--model', model, option, file)
    assert f'cannot write {file}: there is no folder {file.parent}' in error
    file.parent.mkdir()
    assert main(['replay', str(bag), '--model', str(model), option, str(file)]) == 0
    assert file.read_text()


def test_folders_that_are_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'file'
    file.touch()
    assert f'cannot write {file}: File exists' in refused(capsys, 'demo', '--out', file)


@pytest.mark.parametrize(
    ('option', 'value', 'span'),
    [('--alpha', '0', 'above 0 and below 1'), ('--scatter', '-0.1', 'from 0 on and below 1')],
)
def test_rates_and_shares(
    option: str, value: str, span: str, capsys: pytest.CaptureFixture[str]
) -> None:
    error = refused(capsys, 'monitor', 'm.yaml', 'none.csv', f'{option}={value}')
    assert f'{option} {value} is no number {span}' in error
