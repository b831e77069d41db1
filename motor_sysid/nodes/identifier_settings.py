"""The parameters of the `identifier` node, and what they mean."""

from dataclasses import dataclass

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.refit import METHODS
from motor_sysid.estimation.online import ESTIMATORS
from motor_sysid.nodes.configuration import Configuration
from motor_sysid.nodes.editing import edited
from motor_sysid.nodes.hidden import parse_assignments
from motor_sysid.nodes.own_effects import add_effect_files
from motor_sysid.nodes.parameters import as_path, parameter
from motor_sysid.nodes.topics import DEFAULT_CONFIG
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motors
from motor_sysid.physics.store import load_model
from motor_sysid.recording.msg_config import load_msg_config
from motor_sysid.recording.sources import MsgConfig

REFIT_METHODS = tuple(name for name in METHODS if name != 'two_stage')
"""What a live refit can do: the reference of the controller is not among the samples."""


@dataclass(frozen=True)
class IdentifierSettings:
    """Parameters of the node."""

    estimator: str = parameter(
        'rls', 'How parameters are estimated online.', '', choices=tuple(ESTIMATORS)
    )
    motor: str = parameter(
        'brushed_dc', 'Kind of the motor.', '',
        choices=tuple(key for key, kind in motors().items() if not kind.prompt),
    )  # fmt: skip
    model_file: str = parameter(
        '', 'YAML file of the model to start from; empty to start from motor and nominal.'
    )
    nominal: tuple[str, ...] = parameter(
        (), 'Start values as name=number in SI units, where there is no model_file.'
    )
    effects: tuple[str, ...] = parameter(
        (), 'Effects that the model has, by key; empty at the start: those of the model_file.',
        live=True,
    )  # fmt: skip
    effect_files: tuple[str, ...] = parameter(
        (), 'Python files with effects of your own (docs/effects.md); each key is the name of its '
        'file.',
    )  # fmt: skip
    speed_sensor: str = parameter(
        'difference', 'How the drive measures speed, where there is no model_file: as the '
        'difference of the position over the last sample, or ideally; sampled: ideally, and a '
        'filter of it takes sample by sample.', '',
        choices=tuple(sensor.value for sensor in SpeedSensor),
    )  # fmt: skip
    msg_config: str = parameter(
        '', 'File (or name of a shipped one) that says which topic carries which signal.'
    )
    sample_time: float = parameter(
        0.0, 'Time from sample to sample; 0 to learn it from the stamps.', 's', 0, 1
    )
    stamp_tolerance: float = parameter(
        0.0, 'Messages whose stamps differ by no more than this are one sample; 0 to find out: '
        'those with equal stamps are, or every topic has a clock of its own.', 's', 0, 1,
    )  # fmt: skip
    estimate_rate: float = parameter(
        10.0, 'Estimates published per second of sample time.', 'Hz', 0.01, 1000
    )
    prediction_rate: float = parameter(
        50.0, 'Predictions and residuals published per second of sample time.', 'Hz', 0.01, 2000
    )
    drain_period: float = parameter(0.002, 'Messages are taken this often.', 's', 0.0005, 0.1)
    time_budget: float = parameter(
        0.0002, 'Time for the estimator at a stretch; samples that it does not get to wait.', 's',
        1e-5, 1, live=True,
    )  # fmt: skip
    refit_period: float = parameter(
        0.0, 'Refit after this much sample time; 0 for on request only.', 's', 0, 1e5, live=True
    )
    refit_window: float = parameter(10.0, 'Length of data in a refit.', 's', 0.1, 1e4, live=True)
    refit_method: str = parameter(
        'pso',
        'Optimizer of the refit, which least squares polish, or these alone.',
        '',
        choices=REFIT_METHODS,
        live=True,
    )
    refit_seed: int = parameter(0, 'Seed of the optimizer.', '', 0, 2**31 - 1, live=True)
    diagnose_period: float = parameter(
        0.0, 'Diagnose after this much sample time; 0 for on request only.', 's', 0, 1e5, live=True
    )
    diagnose_window: float = parameter(
        20.0, 'Length of data in a diagnosis.', 's', 1, 1e4, live=True
    )
    diagnose_alpha: float = parameter(
        0.01, 'False-alarm rate of a diagnosis, where a calibration of the motor is stored.', '',
        1e-4, 0.5, live=True,
    )  # fmt: skip
    watch_period: float = parameter(
        0.0, 'Compare the estimates with the model_file after this much sample time, for '
        'alarms on /diagnostics; 0 for never.', 's', 0, 1e5,
    )  # fmt: skip
    watch_alpha: float = parameter(
        0.01, 'Chance of any false alarm, however long the motor is watched.', '', 1e-9, 0.5
    )
    watch_scatter: float = parameter(
        0.02, 'Relative standard deviation by which parameters of a good motor differ from day '
        'to day.', '', 0, 1,
    )  # fmt: skip
    window_samples: int = parameter(
        30_000, 'Samples kept for refits and diagnoses; more than that are never looked at.', '',
        100, 10**7,
    )  # fmt: skip

    def model(self) -> Model:
        """Return the model to start from."""
        add_effect_files(self.effect_files)
        if self.model_file:
            if self.nominal:
                raise UserError('give `model_file` or `nominal`, not both')
            return load_model(as_path(self.model_file))
        return Model.base(
            self.motor, parse_assignments(self.nominal),
            speed_sensor=SpeedSensor(self.speed_sensor),
        )  # fmt: skip

    def configuration(self) -> Configuration:
        """Return what the estimates depend on."""
        model = self.model()
        return Configuration(
            edited(model, self.effects or model.effects), self.estimator, self.sample_time,
            self.estimate_rate, self.prediction_rate, self.stamp_tolerance,
        )  # fmt: skip

    def messages(self) -> MsgConfig:
        """Return which topic carries which signal."""
        return load_msg_config(as_path(self.msg_config)) if self.msg_config else DEFAULT_CONFIG
