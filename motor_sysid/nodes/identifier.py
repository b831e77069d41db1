"""The `identifier` node: live estimates with their uncertainty, predictions, periodic refits."""

from collections.abc import Sequence
from dataclasses import dataclass
import time

from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from motor_sysid.errors import UserError
from motor_sysid.estimation.stream import Event
from motor_sysid.nodes.configuration import Configuration, SECOND
from motor_sysid.nodes.health import Health
from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.loop import LoopNode
from motor_sysid.nodes.loop import main as run
from motor_sysid.nodes.parameters import parameter, Settings
from motor_sysid.nodes.pipeline import DEFAULT_SOURCES
from motor_sysid.nodes.plant import parse_assignments
from motor_sysid.nodes.publishing import (
    DiagnosticsPublisher,
    joint_publisher,
    LATCHED,
    now_ns,
    PackedPublisher,
)
from motor_sysid.nodes.refit import RefitJob, RefitOutcome, RefitWorker
from motor_sysid.nodes.statuses import estimate_statuses, fit_statuses, Status
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motors
from motor_sysid.physics.store import load_model
from motor_sysid.recording.msg_config import load_msg_config
from motor_sysid.recording.sources import Source

ESTIMATORS, METHODS = ('ekf', 'rls'), ('pso', 'gwo')
FIELDS = {'position': 'position', 'speed': 'velocity', 'current': 'effort'}
"""Signal to the field of `JointState` that carries its prediction; effort holds the current, A."""


@dataclass(frozen=True)
class IdentifierSettings:
    """Parameters of the node."""

    estimator: str = parameter(
        'ekf', 'How parameters are estimated online.', '', choices=ESTIMATORS
    )
    motor: str = parameter('brushed_dc', 'Kind of the motor.', '', choices=tuple(motors()))
    model_file: str = parameter(
        '', 'YAML file of the model to start from; empty to start from motor and nominal.'
    )
    nominal: tuple[str, ...] = parameter(
        (), 'Start values as name=number in SI units, where there is no model_file.'
    )
    speed_sensor: str = parameter(
        'difference', 'How the drive measures speed, where there is no model_file: as the '
        'difference of the position over the last sample, or ideally.', '',
        choices=tuple(sensor.value for sensor in SpeedSensor),
    )  # fmt: skip
    msg_config: str = parameter(
        '', 'File (or name of a shipped one) that says which topic carries which signal.'
    )
    sample_time: float = parameter(
        0.0, 'Time from sample to sample; 0 to learn it from the stamps.', 's', 0, 1
    )
    stamp_tolerance: float = parameter(
        0.0, 'Stamps of one sample may differ by this much.', 's', 0, 1
    )
    estimate_rate: float = parameter(
        10.0, 'Estimates published per second of sample time.', 'Hz', 0.01, 1000
    )
    prediction_rate: float = parameter(
        50.0, 'Predictions and residuals published per second of sample time.', 'Hz', 0.01, 2000
    )
    drain_period: float = parameter(0.002, 'Messages are taken this often.', 's', 0.0005, 0.1)
    time_budget: float = parameter(
        0.0005, 'Time for the estimator at a stretch; samples that it does not get to wait.', 's',
        1e-5, 1, live=True,
    )  # fmt: skip
    refit_period: float = parameter(
        0.0, 'Refit after this much sample time; 0 for on request only.', 's', 0, 1e5, live=True
    )
    refit_window: float = parameter(10.0, 'Length of data in a refit.', 's', 0.1, 1e4, live=True)
    refit_method: str = parameter('pso', 'Swarm of the refit.', '', choices=METHODS, live=True)
    refit_seed: int = parameter(0, 'Seed of the swarm.', '', 0, 2**31 - 1, live=True)
    window_samples: int = parameter(
        30_000, 'Samples kept for refits; more than that are never looked at.', '', 100, 10**7
    )

    def model(self) -> Model:
        """Return the model to start from."""
        if self.model_file:
            if self.nominal:
                raise UserError('give `model_file` or `nominal`, not both')
            return load_model(self.model_file)
        return Model.base(
            self.motor, parse_assignments(self.nominal),
            speed_sensor=SpeedSensor(self.speed_sensor),
        )  # fmt: skip

    def configuration(self) -> Configuration:
        """Return what the estimates depend on."""
        return Configuration(
            self.model(), self.estimator, self.sample_time, self.estimate_rate,
            self.prediction_rate, self.stamp_tolerance,
        )  # fmt: skip

    def sources(self) -> tuple[Source, ...]:
        """Return which topic carries which signal."""
        if not self.msg_config:
            return DEFAULT_SOURCES
        return load_msg_config(self.msg_config).all_sources()


class IdentifierNode(LoopNode):
    """Takes three topics in batches, joins them on their stamps and feeds the estimator.

    What is published on ``~/estimate`` depends on the samples alone; refits run in a process of
    their own and are published on ``~/model`` only, so that a replay gives the same estimates.
    """

    def __init__(
        self, context: Context | None = None, overrides: Sequence[Parameter] = ()
    ) -> None:
        super().__init__(
            'identifier', context=context, parameter_overrides=list(overrides),
            automatically_declare_parameters_from_overrides=True,
        )  # fmt: skip
        self.settings = Settings(self, IdentifierSettings)
        s = self.settings.value
        self.period = s.drain_period
        self._configuration = s.configuration()
        self._configuration.warm_up()
        plans = self._configuration.plans(s.sources())
        self._pipeline = self._configuration.pipeline(plans, s.window_samples)
        self._worker = RefitWorker()
        self._fitted: RefitOutcome | None = None
        self._next_refit = 0
        self._advertise()
        self._topics = [RawTopic(self, plan.topic, plan.message_type) for plan in plans]
        self._health = Health(self._pipeline, self._topics)
        self._next_look = 0.0
        self._publish_model()
        if s.refit_period:
            self._worker.start()
        self.get_logger().info(
            f'{s.estimator} on {", ".join(topic.resolved for topic in self._topics)}'
        )

    def _advertise(self) -> None:
        deep = QoSProfile(depth=100)
        self._estimate = DiagnosticsPublisher(self, '~/estimate', deep)
        self._model = DiagnosticsPublisher(self, '~/model', LATCHED)
        self._diagnostics = DiagnosticsPublisher(self, '/diagnostics', QoSProfile(depth=10))
        self._shown = [name for name in FIELDS if name in self._configuration.outputs()]
        self._prediction = self._joint('~/prediction')
        self._residual = self._joint('~/residual')
        self.create_service(Trigger, '~/reset', self._on_reset)
        self.create_service(Trigger, '~/refit', self._on_refit)

    def _joint(self, topic: str) -> PackedPublisher:
        fields = [FIELDS[name] for name in self._shown]
        return joint_publisher(self, topic, 'motor', fields, QoSProfile(depth=200))

    def step(self) -> None:
        """Take what has come, and publish what is due."""
        with self._health.timed() as batch:
            batch.waiting = self.hurry
            for k, topic in enumerate(self._topics):
                messages = topic.drain()
                batch.messages += len(messages)
                for message in messages:
                    self._pipeline.push(k, message.data, message.received)
            for event in self._pipeline.advance(self.settings.value.time_budget):
                self._publish(event)
        self.hurry = self._pipeline.collect() > 0
        self._look()

    def close(self) -> None:
        """Stop the worker."""
        self._worker.close()

    def _publish(self, event: Event) -> None:
        self._health.note(event)
        predicted, left = event.prediction, event.residual
        self._prediction.publish(event.stamp, *(predicted[name] for name in self._shown))
        self._residual.publish(event.stamp, *(left[name] for name in self._shown))
        if event.estimate is not None:
            self._estimate.publish(event.stamp, estimate_statuses(event))
            self._refit_if_due(event)

    def _refit_if_due(self, event: Event) -> None:
        period = self.settings.value.refit_period
        if not period or event.stamp < self._next_refit:
            return
        if event.stamp - event.first_stamp < self.settings.value.refit_window * SECOND:
            return
        if self._submit():
            self._next_refit = event.stamp + round(period * SECOND)

    def _submit(self) -> bool:
        s = self.settings.value
        record = self._pipeline.record(s.refit_window)
        if record is None:
            return False
        model = self._configuration.model
        return self._worker.submit(RefitJob(model, record, s.refit_method, s.refit_seed))

    def _look(self) -> None:
        """Look at what changes slowly."""
        outcome = self._worker.poll()
        if outcome is not None:
            self._take_refit(outcome)
        now = time.monotonic()
        if now < self._next_look:
            return
        self._next_look = now + 1.0
        for topic in self._topics:
            if topic.adapt():
                self.get_logger().info(f'{topic.resolved}: now as its publisher offers it')
        statuses = self._health.statuses(self._fitted.noise if self._fitted else {})
        self._diagnostics.publish(now_ns(self.get_clock()), statuses)

    def _take_refit(self, outcome: RefitOutcome) -> None:
        if outcome.model is None:
            self.get_logger().warning(f'refit failed: {outcome.reason}')
            return
        self._fitted = outcome
        self._health.refits += 1
        self._publish_model()

    def _publish_model(self) -> None:
        statuses = [Status('configuration', self._configuration.to_texts())]
        if self._fitted is not None:
            statuses += fit_statuses(self._fitted)
        self._model.publish(now_ns(self.get_clock()), statuses)

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._pipeline.reset()
        self._next_refit = 0
        response.success, response.message = True, 'starts anew with the next sample'
        return response

    def _on_refit(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._submit()
        busy = 'a refit runs already' if self._worker.busy else 'there are no samples yet'
        response.message = 'started; the result comes on ~/model' if response.success else busy
        return response


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run(IdentifierNode, args)


if __name__ == '__main__':
    raise SystemExit(main())
