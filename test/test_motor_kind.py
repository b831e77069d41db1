"""Which motor kind is chosen, what is said where none fits, and which signals are passed over."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recording_tools import motor_record
from three_phase_records import bldc_record, PMSM, pmsm_record

from motor_sysid.cli import main
from motor_sysid.diagnosis import diagnose
from motor_sysid.diagnosis.fitting import compare_model, fit_model
from motor_sysid.diagnosis.search.motor_kind import (
    choose_kind,
    is_field_lost,
    passed_over,
    remarks,
    remarks_on_field,
    remarks_on_units,
    told_kind,
    used_signals,
)
from motor_sysid.diagnosis.search.rotor_axes import axes_told
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor
from motor_sysid.physics.store import save_model
from motor_sysid.recording.save import write_record
from motor_sysid.signals.doctor import examine
from motor_sysid.signals.record import Provenance, Record

FULL = motor_record(2000)
NOTE = 'b.csv has no current; the current of a.csv is not used'


def named(name: str, *signals: str) -> Record:
    """Return a record of some signals of a motor, as if read from a file."""
    return replace(FULL.select(signals), provenance=Provenance(name))


def duty(*others: str) -> Record:
    return FULL.select(others).with_signal('duty', FULL['voltage'] / 24, '1')


A, B = named('a.csv', 'voltage', 'current', 'speed'), named('b.csv', 'voltage', 'speed')


def test_a_current_beside_a_duty_cycle_drives_only_what_is_asked_for() -> None:
    record = duty('current', 'speed')
    with pytest.raises(UserError, match=r'no motor kind .* `supply_voltage: {constant: 24}`'):
        choose_kind([record], None)
    assert choose_kind([record], 'mechanical_axis').key == 'mechanical_axis'
    assert choose_kind([FULL.select(['current', 'speed'])], None).key == 'mechanical_axis'
    torque = record.with_signal('torque', FULL['current'], 'N m')
    assert choose_kind([torque], None).key == 'mechanical_axis'
    voltage = record.with_signal('voltage', FULL['voltage'], 'V')
    assert choose_kind([voltage], None).key == 'brushed_dc'


@pytest.mark.parametrize(
    ('wanted', 'needed'),
    [
        (
            'pmsm', 'a permanent magnet synchronous motor needs voltage_d, voltage_q as input, '
            'current_d, current_q, and speed or position; or, as `pmsm_q`, voltage_q as input, '
            'current_q, and speed or position. ',
        ),
        ('bldc', 'voltage_a, voltage_b, voltage_c as input, current_a, current_b, and position.'),
        (
            'mechanical_axis',
            'torque or force or current or current_q as input, and speed or position.',
        ),
    ],
)  # fmt: skip
def test_a_wanted_kind_says_what_it_needs(wanted: str, needed: str) -> None:
    with pytest.raises(UserError) as problem:
        choose_kind([B], wanted)
    assert needed in str(problem.value)
    assert 'These data have speed, voltage; name what is missing' in str(problem.value)


def phases(offset: float) -> Record:
    """Return a synchronous motor in phases; d is at `offset` where the encoder is at zero."""
    record = pmsm_record(2.0)[1]
    names = [f'voltage_{p}' for p in 'abc'] + ['current_a', 'current_b', 'speed', 'position']
    position = record['position'] - offset / PMSM.pole_pairs
    return record.select(names).with_signal('position', position, 'rad')


def test_a_synchronous_motor_is_fitted_from_its_phases(tmp_path: Path) -> None:
    """Pole pairs and encoder zero come from them, and stay with the model."""
    record = phases(1.3)
    rung = fit_model([record], motor='pmsm')
    model, machine = rung.model, PMSM
    assert (model['pole_pairs'], model['angle_offset']) == (4.0, pytest.approx(1.3, abs=0.03))
    assert any('made from the phases, with the 4 pole pairs' in n for n in rung.result.warnings)
    for name, true in (('R', machine.R), ('L_q', machine.L_q), ('psi_f', machine.k_e / 4)):
        assert model[name] == pytest.approx(true, rel=0.05)
    assert compare_model(model, [record])[0].error_percent < 2 * rung.training.error_percent
    given = {'pole_pairs': 4.0, 'angle_offset': 1.25}
    assert axes_told([record], 'pmsm', given) == axes_told([record], None, {}) == {}
    assert fit_model([record], motor='pmsm', nominal=given).model['angle_offset'] == 1.25


def test_phases_that_do_not_tell_d_and_q_are_refused_with_what_helps() -> None:
    record = phases(0.0)
    still = record.with_signal('position', 0.0 * record.time, 'rad')
    swapped = record.with_signal('voltage_b', record['voltage_c'], 'V')
    swapped = swapped.with_signal('voltage_c', record['voltage_b'], 'V')
    for records, known, why in (
        ([still], {}, 'the motion does not tell'), ([swapped], {}, 'turn against the shaft'),
        ([record], {'pole_pairs': 7.0}, 'show 4 pole pairs, and 7 are given'),
        ([record, phases(1.0)], {}, 'from record to record'),
    ):  # fmt: skip
        with pytest.raises(UserError, match=f'{why}.*motor-sysid check.*with_dq'):
            fit_model(records, motor='pmsm', nominal=known)
    with pytest.raises(UserError, match=r'`position`.*motor-sysid check.*with_dq'):
        fit_model([record.select([n for n in record if n != 'position'])], motor='pmsm')


def test_that_phases_are_taken_for_a_trapezoid_is_told() -> None:
    record = bldc_record(1.0)[1]
    assert any('--motor pmsm' in note for note in remarks(motor('bldc'), [record], None))
    assert not any('--motor pmsm' in note for note in remarks(motor('bldc'), [record], 'bldc'))


@pytest.mark.parametrize(
    ('records', 'notes'),
    [
        ((A, A), ()),
        ((A, B), (NOTE,)),
        ((A, B, replace(B, provenance=Provenance('c.csv'))),
         ('b.csv, c.csv have no current; the current of a.csv is not used',)),
        ((named('a.csv', *FULL), named('b.csv', 'voltage', 'current', 'position')),
         ('b.csv has no speed; the speed of a.csv is not used',)),
        ((named('a.csv', 'voltage', 'current', 'speed'), named('b.csv', 'current', 'speed')),
         ('b.csv has no voltage; the voltage of a.csv is not used',)),
    ],
)  # fmt: skip
def test_what_some_records_lack_is_told(records: tuple[Record, ...], notes: tuple[str]) -> None:
    assert passed_over(records, lambda some: used_signals(some, None)) == notes


def test_fits_and_diagnoses_tell_what_is_passed_over() -> None:
    assert NOTE in fit_model([A], [B]).result.warnings
    found = diagnose([A], [B], effects=['coulomb_friction'])
    assert NOTE in found.warnings
    assert not any('is not used' in text for text in fit_model([A]).result.warnings)


def test_records_that_are_driven_or_measured_otherwise_are_of_no_one_motor() -> None:
    linear = {'force': 'N', 'speed': 'm/s'}
    signals = dict.fromkeys(linear, FULL['speed'])
    axis = Record(FULL.time, signals, linear, Provenance('axis.csv'))
    driven = named('a.csv', 'current', 'speed')
    with pytest.raises(UserError, match=r'a\.csv has current and rotation, axis\.csv force'):
        fit_model([driven], [axis])


@pytest.mark.parametrize('held', [(), (B,)])
def test_data_that_lack_what_a_given_model_needs_are_refused(held: tuple[Record, ...]) -> None:
    train = [A] if held else [B]
    words = r'the model is a brushed DC motor, and needs .* current.*brushed_dc_reduced'
    for work in (fit_model, diagnose):
        with pytest.raises(UserError, match=words):
            work(train, held, model=Model.base('brushed_dc'))


def test_a_record_without_voltage_beside_one_with_it_is_an_axis() -> None:
    """The doctor looked for the voltage of the longest one in all of them."""
    other = named('b.csv', 'current', 'speed').slice(0, 1500)
    found = fit_model([A, other])
    assert found.model.motor == 'mechanical_axis'
    assert any('voltage of a.csv is not used' in text for text in found.result.warnings)
    assert any(one.code for one in examine([A, other]))


def test_effects_of_which_none_makes_sense_are_no_complete_model() -> None:
    with pytest.raises(UserError, match='none of the effects asked for makes sense for a brushed'):
        diagnose([A], effects=['rotor_angle_lag'])


def test_compare_tells_it_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for record in (A, B):
        write_record(record, tmp_path / record.provenance.source)
    save_model(Model.base('brushed_dc'), tmp_path / 'm.yaml')
    files = [str(tmp_path / name) for name in ('m.yaml', 'a.csv', 'b.csv')]
    assert main(['compare', *files]) == 0
    assert f'note: {files[2]} has no current; the current of {files[1]}' in capsys.readouterr().out


@pytest.mark.parametrize(('dt', 'told'), [(1e-3, False), (1e-2, True)])
def test_a_field_that_turns_far_from_sample_to_sample_is_told(dt: float, told: bool) -> None:
    """7 pole pairs at 100 rad/s turn by 0.7 or 7 electrical rad within a sample."""
    speed = np.full(500, 100.0)
    record = Record(dt * np.arange(500), {'speed': speed}, {'speed': 'rad/s'})
    lines = remarks_on_field(motor('pmsm'), [record], {'pole_pairs': 7.0})
    assert len(lines) == told
    if told:
        assert 'by 401 degrees from sample to sample' in lines[0]
        assert 'record at 1400 Hz' in lines[0]
        assert '--motor mechanical_axis' in lines[0]
        of_pair = remarks_on_field(motor('bldc_six_step'), [record], {'pole_pairs': 7.0})[0]
        assert 'q current' not in of_pair
        assert 'is held here' not in of_pair
    assert remarks_on_field(motor('brushed_dc'), [record], {}) == ()


def telemetry(dt: float, speed: float) -> Record:
    """Return what a drive under field-oriented control tells, while its q current pulls."""
    time = dt * np.arange(400)
    pull = 20.0 * np.repeat(np.random.default_rng(5).uniform(0.2, 1.0, 8), 50)
    turning = np.zeros(400)
    for k in range(399):
        turning[k + 1] = turning[k] + 4.0 * dt * (pull[k] - 20.0 * turning[k] / speed)
    signals = {'voltage_d': -0.1 * pull, 'voltage_q': 0.1 * turning + 0.1 * pull,
               'current_d': 0.0 * pull, 'current_q': pull, 'speed': turning}  # fmt: skip
    units = {n: 'V' if 'voltage' in n else 'A' if 'current' in n else 'rad/s' for n in signals}
    return Record(time, signals, units)


def test_where_the_field_is_lost_the_axis_alone_is_fitted() -> None:
    """At 20 Hz and 150 rad/s even one pole pair turns by more than a turn from row to row."""
    record = telemetry(0.05, 200.0)
    assert is_field_lost(motor('pmsm'), [record], {})
    assert told_kind([record], None) == 'mechanical_axis'
    assert told_kind([record], 'pmsm') == 'pmsm'
    model = fit_model([record])
    assert model.model.motor == 'mechanical_axis'
    assert model.model['J'] == pytest.approx(0.25, rel=0.03)
    assert any('with the q current as what drives it' in text for text in model.result.warnings)


@pytest.mark.parametrize(('pairs', 'lost'), [({}, False), ({'pole_pairs': 7.0}, True)])
def test_pole_pairs_that_are_known_count(pairs: dict[str, float], lost: bool) -> None:
    assert is_field_lost(motor('pmsm'), [telemetry(0.01, 300.0)], pairs) == lost
    assert (told_kind([telemetry(0.01, 300.0)], None, pairs) == 'mechanical_axis') == lost


def test_a_torque_constant_that_is_known_gives_an_axis_its_units() -> None:
    """Of an axis that a current drives, the data show inertia and friction per ampere."""
    record = telemetry(0.05, 200.0).select(['current_q', 'speed'])
    bare = fit_model([record], motor='mechanical_axis')
    sheet = fit_model([record], motor='mechanical_axis', nominal={'k_t': 0.05})
    magnet = {'pole_pairs': 7.0, 'psi_f': 0.01}
    assert any('torques are in ampere' in text for text in bare.result.warnings)
    for model, gain in ((sheet, 0.05), (fit_model([record], nominal=magnet), 0.105)):
        assert model.model['gain'] == pytest.approx(gain)
        assert model.model['J'] == pytest.approx(gain * bare.model['J'], rel=1e-4)
        assert not any('in ampere' in text for text in model.result.warnings)


def test_a_torque_that_is_measured_needs_no_torque_constant() -> None:
    """Nor does the voltage of a whole motor; motion that is given to a current does."""
    moved = FULL.select(['speed', 'position'])
    torque = moved.with_signal('torque', FULL['current'], 'N m')
    model = fit_model([torque], nominal={'k_t': 0.05})
    assert model.model['gain'] == 1.0
    assert remarks_on_units(model.model.kind, [torque], {'gain': 1.0}) == ()
    assert remarks_on_units(motor('brushed_dc'), [FULL], {'k_t': 1.0}) == ()
    inverse = motor('inverse_axis')
    moved = moved.with_signal('acceleration', FULL['speed'], 'rad/s^2')
    assert '(`k_t`)' in remarks_on_units(inverse, [moved], {'k_t': 1.0})[0]
    moved = moved.with_signal('current', FULL['current'], 'A')
    assert inverse.start([moved], {'k_t': 0.04})['k_t'] == 0.04
