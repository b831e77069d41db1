"""Diagnosis: compare, see where a model fails, learn what is missing, add it.

The rooms, in the order in which they build on each other: `result`, `where`, `candidates`,
`search`; on top of these `verdict`, `calibration`, `change`, `condition` and `experiment`.  The
modules beside them put the rooms together: begin with `diagnose` and `engine`.
"""

from motor_sysid.diagnosis.diagnose import diagnose
from motor_sysid.diagnosis.experiment import Experiment, Limits, suggest_experiment
from motor_sysid.diagnosis.result.curves import Curve, Where
from motor_sysid.diagnosis.result.result import Candidate, Diagnosis, Step, Verdict
from motor_sysid.diagnosis.settings import Settings
from motor_sysid.diagnosis.suggest import suggest
from motor_sysid.diagnosis.where.compare import compare

__all__ = [
    'Candidate', 'Curve', 'Diagnosis', 'Experiment', 'Limits', 'Settings', 'Step', 'Verdict',
    'Where', 'compare', 'diagnose', 'suggest', 'suggest_experiment',
]  # fmt: skip
