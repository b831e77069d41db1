"""The choice of the next experiment: what separates rivals or informs weak parameters.

In reading order: `limits` (what the motor may be asked to do), `stage` (where experiments are
simulated), `library` (excitations to choose from), `information` and `determine` (what sharpens
weak parameters), `separate` and `discriminate` (what tells rivals apart), `relax`, `result`,
`words`, `choose`; `rivals` (fits of the rivals that people name), `next_experiment` (after a
diagnosis).
"""

from motor_sysid.diagnosis.experiment.choose import suggest_experiment
from motor_sysid.diagnosis.experiment.limits import Limits, limits_of
from motor_sysid.diagnosis.experiment.result import Experiment, Separation, Sharpening

__all__ = [
    'Experiment', 'Limits', 'Separation', 'Sharpening', 'limits_of', 'suggest_experiment',
]  # fmt: skip
