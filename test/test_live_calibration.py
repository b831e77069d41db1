"""A live diagnosis asks for the evidence that the user's stored calibrations tell."""

import pytest
from test_calibration import a_calibration, FEW, recording, start

from motor_sysid import diagnosis
from motor_sysid.diagnosis.calibration.store import save_calibration
from motor_sysid.nodes.live_diagnosis import DiagnosisJob


@pytest.mark.parametrize(('alpha', 'words'), [(0.05, 'rate 5 %'), (0.2, 'rate 20 %')])
def test_stored_calibrations_are_used_at_the_rate_that_is_asked_for(
    alpha, words, tmp_path, monkeypatch
):
    whole = diagnosis.diagnose
    monkeypatch.setattr(diagnosis, 'diagnose', lambda *a, **b: whole(*a, **b, effects=FEW))
    monkeypatch.setenv('MOTOR_SYSID_CALIBRATION', str(tmp_path))
    save_calibration(a_calibration(), tmp_path / 'mine.yaml')
    (tmp_path / 'broken.yaml').write_text('kind: [')
    found = DiagnosisJob(start(), recording(0), 0, 0.0, alpha).work()
    assert any('from a calibration' in line and words in line for line in found.reasons)
    assert any('broken.yaml' in line for line in found.warnings)
