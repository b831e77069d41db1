"""What verbs read: looked over as `check` does; twins, data sheets and slips told in words."""

import json
from pathlib import Path
import re
from types import SimpleNamespace

import numpy as np
import pytest
from recording_tools import motor_record

from motor_sysid.cli import main
from motor_sysid.diagnosis import fitting
from motor_sysid.errors import UserError
from motor_sysid.physics.datasheet import load_datasheet
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor, motors
from motor_sysid.physics.store import load_model, save_model
from motor_sysid.recording.save import write_record
from motor_sysid.signals.record import Record

RPM = 60 / (2 * np.pi)
SHEET = 'motor_type: brushed_dc\nnominal: {torque_constant_Nm_per_A: 0.05}\n'
ELECTRICAL = ('voltage', 'current', 'speed')


def made(path: Path, record: Record, names: tuple[str, ...] = ELECTRICAL) -> Path:
    """Write some signals of a record."""
    write_record(record.select(names), path)
    return path


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return made(tmp_path / 'a.csv', motor_record(2000))


@pytest.fixture
def in_rpm(tmp_path: Path) -> Path:
    record = motor_record(2000)
    wrong = record.with_signal('speed', record['speed'] * RPM, 'rad/s')
    return made(tmp_path / 'rpm.csv', wrong)


@pytest.fixture
def model(tmp_path: Path) -> Path:
    save_model(Model.base('brushed_dc', {'R': 2.0, 'J': 2e-5}), tmp_path / 'm.yaml')
    return tmp_path / 'm.yaml'


def file(tmp_path: Path, text: str, name: str = 'sheet.yaml') -> Path:
    (tmp_path / name).write_text(text)
    return tmp_path / name


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Return what is said of arguments that are refused."""
    assert main([str(argument) for argument in arguments]) == 2
    return capsys.readouterr().err


def told(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Return what is said beside the result."""
    assert main([str(argument) for argument in arguments]) == 0
    return capsys.readouterr().err


@pytest.mark.parametrize('verb', ['check', 'fit', 'diagnose', 'learn', 'workbench'])
def test_every_verb_asks_the_data_sheet_for_the_unit_of_speed(
    verb: str, in_rpm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([verb, str(in_rpm), '--nominal', str(file(tmp_path, SHEET))]) == 2
    said = capsys.readouterr()
    assert 'speed seems to be in rpm' in (said.out if verb == 'check' else said.err)


def test_what_is_doubtful_is_told_in_a_line_for_each_kind(
    data: Path, model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = motor_record(2000)
    fast = record.with_signal('speed', 40 * record['speed'], 'rad/s')
    odd = made(data.with_name('fast.csv'), fast)
    for call in (['fit', odd], ['compare', model, odd]):
        lines = told(capsys, *call).splitlines()
        assert f'{odd}: speed reaches' in lines[0]
        assert lines[1].startswith('note: `motor-sysid check` tells what follows')
        assert len(lines) == 2
    assert told(capsys, 'fit', data) == ''


def test_what_is_fitted_does_not_judge(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    twin = data.with_name('twin.csv')
    twin.write_bytes(data.read_bytes())
    for held in (data, twin):
        error = refused(capsys, 'fit', data, '--validate', held)
        assert f'{held} of --validate is fitted as well ({data}), so it cannot judge' in error


def test_a_recording_that_is_given_twice_counts_once(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert told(capsys, 'fit', data) == ''
    once = main(['fit', str(data)]), capsys.readouterr().out
    twice = main(['fit', str(data), str(data)]), capsys.readouterr()
    assert twice[1].err == f'note: {data} repeats {data}; it counts once\n'
    assert (twice[0], twice[1].out) == once


@pytest.mark.parametrize(
    ('text', 'meant'),
    [
        ('nominal: {resistance_Ohm: 1.0}', 'resistance_ohm'),
        ('nominal: {inertia: 3.0e-5}', 'inertia_total_kgm2'),
        ('nominal: {inductance_mH: 2}', 'inductance_H'),
        ('nominal: {J: 3.0e-5}', 'inertia_total_kgm2'),
        ('motor_type: pmsm\npole_pairs: 4', 'pole_pairs` under `nominal'),
        ('motor_typ: pmsm\nnominal: {pole_pairs: 4}', 'motor_type'),
        ('supply_voltage: 24\nnominal: {pole_pairs: 4}', 'supply_voltage_V'),
    ],
)
def test_slips_in_a_data_sheet_are_refused_with_a_guess(
    text: str, meant: str, tmp_path: Path, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    error = refused(capsys, 'fit', data, '--nominal', file(tmp_path, text))
    assert 'unknown entry `' in error
    assert f'did you mean `{meant}`' in error


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('motor_type: [brushed_dc]', "motor_type `['brushed_dc']` is not known"),
        ('nominal: {resistance_ohm: .inf}', '`resistance_ohm` is inf; it must be a finite number'),
        ('nominal: {resistance_ohm: 1' + 400 * '0' + '}', 'it must be a finite number above 0'),
        ('nominal: {resistance_ohm: two}', "`resistance_ohm` is 'two'; it must be a finite"),
        ('encoder_counts_per_rev: -3', '`encoder_counts_per_rev` is -3; it must be a finite'),
        ('nominal: {resistance_ohm: 1, resistance_ohm: 2}', 'key `resistance_ohm` stands twice'),
        (
            'nominal: {resistance_ohm: 1, phase_resistance_ohm: 2}',
            '`resistance_ohm` and `phase_resistance_ohm` both give `R`; leave one',
        ),
    ],
)
def test_values_that_no_data_sheet_can_have(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(UserError, match=re.escape(message)):
        load_datasheet(file(tmp_path, text))


def test_a_number_without_a_dot_is_a_number(tmp_path: Path) -> None:
    assert load_datasheet(file(tmp_path, 'nominal: {inductance_H: 1e-3}')).nominal == {'L': 1e-3}


def test_what_a_data_sheet_has_beside_is_no_slip(
    tmp_path: Path, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    printed = 'rated_current_A: 2, rated_voltage_V: 24, back_emf_constant_Vs_per_rad: 0.05'
    people = 'name: RE 35\nurl: https://example.org\nmass_kg: 0.3\ntolerance_percent: {J: 10}\n'
    sheet = file(tmp_path, f'{people}nominal: {{resistance_ohm: 2.0, {printed}}}')
    assert told(capsys, 'fit', data, '--nominal', sheet) == ''
    assert load_datasheet(sheet).nominal == {'R': 2.0}
    sheet = file(tmp_path, 'nominal: {resistance_ohm: 2.0, mass_kg: 0.3, rotor_inertia_kgm2: 1}')
    assert told(capsys, 'fit', data, '--nominal', sheet) == (
        f'note: the data sheet {sheet} has `mass_kg`, `rotor_inertia_kgm2`, which nothing here '
        'makes use of\n'
    )


def test_what_a_motor_kind_has_no_place_for_is_told(
    tmp_path: Path, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sheet = file(tmp_path, 'nominal: {resistance_ohm: 2.0, magnet_flux_linkage_Vs: 0.01}')
    said = told(capsys, 'fit', data, '--motor', 'brushed_dc', '--nominal', sheet)
    assert said.startswith(f'note: the data sheet {sheet} has `magnet_flux_linkage_Vs`, which')
    assert told(capsys, 'fit', data, '--nominal', file(tmp_path, SHEET)) == ''
    assert not load_datasheet(sheet, 'mechanical_axis').unread
    terminals = file(tmp_path, 'nominal: {back_emf_constant_line_line_Vs_per_rad: 0.1}')
    assert load_datasheet(terminals, 'brushed_dc').unread
    assert not load_datasheet(terminals, 'bldc').unread
    between = load_datasheet(terminals, 'bldc_six_step')
    assert not between.unread
    assert between.nominal['k_t'] == 0.1


def test_one_inductance_and_a_torque_constant_are_those_of_both_axes(tmp_path: Path) -> None:
    text = 'inductance_H: 0.002, torque_constant_Nm_per_A: 0.06, pole_pairs: 4'
    sheet = file(tmp_path, f'motor_type: pmsm\nnominal: {{{text}, inductance_d_H: 0.0015}}')
    found = load_datasheet(sheet)
    assert not found.unread
    assert found.nominal['L_d'] == 1.5e-3
    assert found.nominal['L_q'] == 2e-3
    assert found.nominal['psi_f'] == pytest.approx(0.01)


@pytest.mark.parametrize('verb', ['fit', 'diagnose', 'learn'])
def test_a_model_and_the_data_sheet_of_another_motor(
    verb: str, model: Path, tmp_path: Path, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sheet = file(tmp_path, 'motor_type: pmsm\nnominal: {resistance_ohm: 99}')
    error = refused(capsys, verb, data, '--model', model, '--nominal', sheet)
    assert f'{model} is a `brushed_dc`, the data sheet {sheet} is of a `pmsm`' in error


def test_a_data_sheet_beside_a_model_only_checks_it(
    model: Path, tmp_path: Path, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sheet = file(tmp_path, SHEET)
    said = told(capsys, 'fit', data, '--model', model, '--nominal', sheet)
    assert said == f'note: values start from {model}, not from the data sheet\n'


def test_a_data_sheet_suits_what_takes_its_motors_place(tmp_path: Path) -> None:
    axes = {'brushed_dc_reduced', 'mechanical_axis', 'inverse_axis'}
    kinds = {
        'pmsm': {'pmsm', 'pmsm_q', *axes},
        'bldc_six_step': {'bldc_six_step', *axes},
    }
    for name, suited in kinds.items():
        sheet = load_datasheet(file(tmp_path, f'motor_type: {name}'))
        assert {k for k in motors() if sheet.suits(motor(k))} == suited
    assert load_datasheet(file(tmp_path, SHEET.splitlines()[1])).suits(motor('bldc'))


@pytest.mark.parametrize(
    'verb', [['compare'], ['add'], ['suggest'], ['monitor']], ids=lambda verb: verb[0]
)
def test_data_in_the_place_of_the_model(
    verb: list[str], model: Path, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    key = ['coulomb_friction'] if verb == ['add'] else []
    error = refused(capsys, *verb, data, *key, model)
    assert error == f'error: {data} is no model; MODEL (YAML) comes first, then DATA\n'


@pytest.mark.parametrize(
    'call', [['fit', '--effect'], ['diagnose', '--effects'], ['calibrate', '--effects']],
    ids=' '.join,
)  # fmt: skip
def test_a_misspelt_effect_is_refused_at_once_with_a_guess(
    call: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    verb, option = call
    for slip, meant in (('coulomb_fricton', 'coulomb_friction'), ('cogging', 'cogging_torque')):
        error = refused(capsys, verb, 'none.csv', option, slip)
        assert error == f'error: unknown effect `{slip}` (did you mean `{meant}`?)\n'
    error = refused(capsys, 'add', 'm.yaml', 'zzz', 'none.csv')
    assert error.startswith('error: unknown effect `zzz`; known are coulomb_friction, ')


def test_an_effect_that_cannot_be_fitted_is_refused_and_nothing_is_written(
    model: Path, data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    before = SimpleNamespace(model=load_model(model))
    trial = SimpleNamespace(rung=before, note='unphysical sign')
    monkeypatch.setattr(fitting, 'add_effect', lambda *_, **__: (before, trial))
    out = tmp_path / 'new.yaml'
    error = refused(capsys, 'add', model, 'quadratic_drag', data, '-o', out)
    assert 'quadratic drag cannot be fitted to these data: unphysical sign; nothing' in error
    assert not out.exists()


def test_a_fit_says_what_the_data_do_not_tell_from_nothing(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / 'fit.json'
    assert main(['fit', str(data), '--effect', 'friction_drift', '--json', str(out)]) == 0
    said = capsys.readouterr().out
    note = 'friction_drift is not told from nothing by these data (friction_drift.d_c = '
    assert f'note: {note}' in said
    assert any(text.startswith(note) for text in json.loads(out.read_text())['warnings'])


def test_a_misspelt_motor_is_guessed(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    error = refused(capsys, 'fit', data, '--motor', 'brushd_dc')
    assert 'unknown motor `brushd_dc` (did you mean `brushed_dc`?); known are ' in error


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ("raise RuntimeError('boom')", 'RuntimeError: boom'),
        ('import numpyy', "ModuleNotFoundError: No module named 'numpyy'"),
        ('def torque(omega k): return 0', 'SyntaxError: '),
        ('import sys; sys.exit(3)', 'SystemExit: 3'),
        ('1 / 0', 'ZeroDivisionError: '),
    ],
)
def test_an_effect_file_that_fails(
    text: str, reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = file(tmp_path, text, 'mine.py')
    error = refused(capsys, 'fit', 'none.csv', '--effect-file', path)
    assert f'effect file {path} cannot be read: {reason}' in error
    assert 'mine' not in catalogue()
