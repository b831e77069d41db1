"""A rotor that stands still: its windings are fitted, and the rest is said not to be seen."""

import json
from pathlib import Path
import warnings

from bench_motor import a_motor, measure, voltage_profile
import numpy as np
import pytest

from motor_sysid.cli import main
from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.fitting import compare_model, fit_model
from motor_sysid.diagnosis.result.document import diagnosis_document
from motor_sysid.diagnosis.search.standstill import held_parameters, stands_still
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor
from motor_sysid.physics.store import save_model
from motor_sysid.recording.save import write_record
from motor_sysid.signals.record import Record
from motor_sysid.workbench.view import build_view

DT, COUNT = 5e-4, 6000
UNITS = {'speed': 'rad/s', 'position': 'rad'}
TRUE = {'R': 1.0, 'L': 2e-3}
COGGING = {'a_1': 2e-3, 'b_1': 1e-3, 'n': 12}


def winding(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return the steps of a voltage and the noisy current of a winding of `TRUE`."""
    voltage = np.repeat(rng.uniform(-12, 12, COUNT // 40), 40)
    current, pole = np.zeros(COUNT), np.exp(-DT * TRUE['R'] / TRUE['L'])
    for k in range(COUNT - 1):
        current[k + 1] = pole * current[k] + (1 - pole) * voltage[k] / TRUE['R']
    return voltage, current + 0.02 * rng.standard_normal(COUNT)


def locked(*axes: str, position: float | None = None) -> Record:
    """Return a record of a locked rotor with a winding for each axis."""
    rng = np.random.default_rng(3)
    signals = {'speed': np.zeros(COUNT)}
    if position is not None:
        signals['position'] = np.full(COUNT, position)
    for axis in axes or ('',):
        signals[f'voltage{axis}'], signals[f'current{axis}'] = winding(rng)
    units = {n: 'V' if 'volt' in n else 'A' for n in signals} | UNITS
    return Record(DT * np.arange(COUNT), signals, {n: units[n] for n in signals})


@pytest.fixture(autouse=True)
def _strict():
    """Nothing is divided by the speed."""
    with warnings.catch_warnings():
        warnings.simplefilter('error', RuntimeWarning)
        yield


@pytest.mark.parametrize('record', [locked(), locked(position=1.25)], ids=['speed', 'position'])
def test_resistance_and_inductance_are_fitted(record: Record) -> None:
    for rung in (fit_model([record]), fit_model([record], [locked()])):
        for name, value in TRUE.items():
            parameter = rung.model.parameters[name]
            assert parameter.value == pytest.approx(value, rel=0.05)
            assert abs(parameter.value - value) < 4 * parameter.sigma
        assert rung.validation.error_percent < 1.0
        assert any('k_t, J, b are held so that it does' in w for w in rung.result.warnings)
        assert not any('not determined' in w for w in rung.result.warnings)


def test_both_axes_of_a_synchronous_motor() -> None:
    found = fit_model([locked('_d', '_q')], motor='pmsm', nominal={'pole_pairs': 4.0}).model
    assert held_parameters(found.kind) == ['psi_f', 'J', 'b']
    for name, value in (('R', 1.0), ('L_d', 2e-3), ('L_q', 2e-3)):
        assert found[name] == pytest.approx(value, rel=0.05)


def test_what_only_motion_tells() -> None:
    assert held_parameters(motor('brushed_dc')) == ['k_t', 'J', 'b']
    assert held_parameters(motor('bldc')) == ['k_e', 'J', 'b']
    assert stands_still([locked(position=2.0)])
    moving = locked().with_signal('speed', np.eye(1, COUNT, 7)[0], 'rad/s')
    assert not stands_still([locked(), moving])
    assert not stands_still([locked().select(['voltage', 'current'])])


def test_the_data_do_not_suffice_for_a_diagnosis() -> None:
    found = diagnose([locked()])
    assert found.verdict is Verdict.INSUFFICIENT_DATA
    assert found.effects == ()
    assert found.reasons[0] == 'These data do not determine the motor: k_t, J, b.'
    assert 'Raise the input until it turns' in found.reasons[1]
    assert found.model['R'] == pytest.approx(1.0, rel=0.02)
    text = json.dumps({**diagnosis_document(found), 'view': build_view(found)}, allow_nan=False)
    assert json.loads(text)['verdict'] == 'insufficient_data'


def test_no_model_is_fitted_there() -> None:
    model = Model.base('brushed_dc')
    for work in (fit_model, diagnose):
        with pytest.raises(UserError, match='tell nothing of its motion'):
            work([locked()], model=model)


def test_a_model_is_compared_by_what_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = Model.base('brushed_dc', {**TRUE, 'k_t': 0.05})
    comparison, where = compare_model(model, [locked()])
    assert comparison.error_percent == comparison.channel_percent['current']
    assert np.isnan(comparison.channel_percent['speed'])
    assert all(np.all(np.isfinite(one.error_share)) for one in where)
    write_record(locked(), tmp_path / 'a.csv')
    save_model(model, tmp_path / 'm.yaml')
    files = [str(tmp_path / name) for name in ('m.yaml', 'a.csv', 'c.json')]
    assert main(['compare', *files[:2], '--json', files[2]]) == 0
    assert 'speed            at rest   RMS' in capsys.readouterr().out
    said = json.loads(Path(files[2]).read_text(), parse_constant=pytest.fail)
    assert said['channel_errors_percent']['speed'] is None


def test_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_record(locked().select(['voltage', 'current']), tmp_path / 'a.csv')
    config = tmp_path / 'lock.yaml'
    config.write_text(
        "time: time [s]\nsignals:\n  voltage: {column: 'voltage [V]'}\n"
        "  current: {column: 'current [A]'}\n  speed: {constant: 0}\n"
    )
    call = [str(tmp_path / 'a.csv'), '--msg-config', str(config), '--json', '-']
    for verb in ('fit', 'diagnose'):
        assert main([verb, *call]) == 0
        assert json.loads(capsys.readouterr().out, parse_constant=pytest.fail)


@pytest.mark.slow
def test_what_a_motor_lacks_is_told_by_its_motion_however_long_it_rests():
    """Three quarters of each record at rest, where counts have no noise: none is the rule then."""
    rng, model = np.random.default_rng(1), a_motor({'cogging_torque': COGGING})
    *train, valid = (
        measure(model, 0.5 * voltage_profile(kind, 8.0, rng) * (np.arange(8000) < 2000), rng)
        for kind in ('steps', 'triangle', 'sines')
    )
    found = diagnose(train, [valid])
    assert found.verdict is Verdict.EFFECT_MISSING
    assert found.model.effects == ('cogging_torque',)
    assert found.model['cogging_torque.a_1'] == pytest.approx(COGGING['a_1'], rel=0.05)
