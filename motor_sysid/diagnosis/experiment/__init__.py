"""The choice of the next experiment: what separates rivals or informs weak parameters."""

from motor_sysid.diagnosis.experiment.choose import suggest_experiment
from motor_sysid.diagnosis.experiment.limits import Limits, limits_of
from motor_sysid.diagnosis.experiment.result import Experiment, Separation, Sharpening

__all__ = [
    'Experiment', 'Limits', 'Separation', 'Sharpening', 'limits_of', 'suggest_experiment',
]  # fmt: skip
