"""The verb report: from a saved report, and from a model and data."""

from dataclasses import replace
import json
import os
from pathlib import Path

from fake_diagnosis import build_diagnosis
import numpy as np
import pytest

from motor_sysid.cli import main
from motor_sysid.physics.model import Model
from motor_sysid.physics.store import save_model
from motor_sysid.signals.record import Provenance
from motor_sysid.workbench.report import write_report
from motor_sysid.workbench.schema import SCHEMA
from motor_sysid.workbench.view import build_view, save_view


@pytest.fixture(scope='module')
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_view(build_view(build_diagnosis(5.0)), tmp_path_factory.mktemp('r') / 'r.json')


def test_a_saved_report_becomes_the_page_again(saved: Path, tmp_path: Path) -> None:
    page = tmp_path / 'page.html'
    assert main(['report', str(saved), '-o', str(page)]) == 0
    assert 'Missing: Coulomb friction and cogging torque' in page.read_text(encoding='utf-8')


def test_a_file_name_that_is_no_unicode_does_not_matter(tmp_path: Path) -> None:
    found = build_diagnosis(2.0)
    source = Provenance(os.fsdecode(b'bags/mesure_\xe9.csv'))
    records = tuple(replace(record, provenance=source) for record in found.records)
    page = write_report(replace(found, records=records), tmp_path / 'page.html')
    assert 'mesure_' in page.read_text(encoding='utf-8')


def test_a_model_and_data_make_a_report(tmp_path: Path) -> None:
    record = build_diagnosis(4.0, rate=250.0).records[0]
    columns = {'time [s]': record.time, 'voltage [V]': record['voltage']}
    rows = np.column_stack([*columns.values(), record['speed']])
    data, model, page = (tmp_path / name for name in ('drive.csv', 'model.yaml', 'page.html'))
    header = ','.join([*columns, 'speed [rad/s]'])
    np.savetxt(data, rows, delimiter=',', header=header, comments='')
    save_model(Model.base('brushed_dc_reduced'), model)
    result = tmp_path / 'report.json'
    call = ['report', str(model), str(data), '-o', str(page), '--json', str(result)]
    assert main(call) == 0
    assert json.loads(result.read_text())['schema'] == SCHEMA
    assert 'drive.csv' in page.read_text(encoding='utf-8')


def test_what_makes_no_report_is_said_in_one_line(
    saved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / 'diagnosis.json'
    other.write_text('{"schema": "motor_sysid/diagnosis/1"}')
    nowhere = tmp_path / 'file'
    nowhere.write_text('')
    calls = {
        'alone makes no report': ['report', str(tmp_path / 'model.yaml')],
        'has schema': ['report', str(other)],
        'cannot read': ['report', str(tmp_path / 'absent.json')],
        '--validate has no effect': ['report', str(saved), '--validate', 'next.csv'],
        '--msg-config has no effect': ['report', str(saved), '--msg-config', 'default'],
        'cannot write': ['report', str(saved), '-o', str(nowhere / 'page.html')],
    }
    for words, call in calls.items():
        assert main(call) == 2
        error = capsys.readouterr().err
        assert error.startswith('error: ')
        assert words in error
        assert error.count('\n') == 1
