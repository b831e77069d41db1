"""Diagnosis: compare, see where a model fails, learn what is missing, add it."""

from motor_sysid.diagnosis.compare import compare
from motor_sysid.diagnosis.diagnose import diagnose, Settings
from motor_sysid.diagnosis.result import Candidate, Curve, Diagnosis, Step, Verdict, Where

__all__ = [
    'Candidate', 'Curve', 'Diagnosis', 'Settings', 'Step', 'Verdict', 'Where', 'compare',
    'diagnose',
]  # fmt: skip
