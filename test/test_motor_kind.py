"""Which motor kind is chosen, what is said where none fits, and which signals are passed over."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recording_tools import motor_record

from motor_sysid.cli import main
from motor_sysid.diagnosis import diagnose
from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.diagnosis.search.motor_kind import (
    choose_kind,
    passed_over,
    remarks_on_field,
    used_signals,
)
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor
from motor_sysid.physics.store import save_model
from motor_sysid.recording.save import write_record
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
        ('mechanical_axis', 'torque or force or current as input, and speed or position.'),
    ],
)  # fmt: skip
def test_a_wanted_kind_says_what_it_needs(wanted: str, needed: str) -> None:
    with pytest.raises(UserError) as problem:
        choose_kind([B], wanted)
    assert needed in str(problem.value)
    assert 'These data have speed, voltage; name what is missing' in str(problem.value)


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
    assert remarks_on_field(motor('brushed_dc'), [record], {}) == ()
