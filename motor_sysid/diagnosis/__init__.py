"""Diagnosis: compare, see where a model fails, learn what is missing, add it."""

from motor_sysid.diagnosis.compare import compare
from motor_sysid.diagnosis.diagnose import diagnose
from motor_sysid.diagnosis.drawn import Curve, Where
from motor_sysid.diagnosis.experiment import Experiment, Limits, suggest_experiment
from motor_sysid.diagnosis.result import Candidate, Diagnosis, Step, Verdict
from motor_sysid.diagnosis.settings import Settings
from motor_sysid.diagnosis.suggest import suggest

__all__ = [
    'Candidate', 'Curve', 'Diagnosis', 'Experiment', 'Limits', 'Settings', 'Step', 'Verdict',
    'Where', 'compare', 'diagnose', 'suggest', 'suggest_experiment',
]  # fmt: skip
