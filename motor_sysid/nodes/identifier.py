"""The `identifier` node: live estimates with their uncertainty, predictions, periodic refits."""

from collections.abc import Sequence
import time

from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from motor_sysid.estimation.stream import Event
from motor_sysid.nodes.configuration import SECOND
from motor_sysid.nodes.health import Health
from motor_sysid.nodes.identifier_settings import IdentifierSettings
from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.loop import LoopNode
from motor_sysid.nodes.loop import main as run
from motor_sysid.nodes.message_types import installed_types
from motor_sysid.nodes.parameters import Settings
from motor_sysid.nodes.pipeline import Pipeline
from motor_sysid.nodes.publishing import (
    DiagnosticsPublisher,
    joint_publisher,
    LATCHED,
    now_ns,
    PackedPublisher,
)
from motor_sysid.nodes.refit import RefitJob, RefitOutcome, RefitWorker
from motor_sysid.nodes.statuses import estimate_statuses, fit_statuses, Status
from motor_sysid.nodes.topics import plan_signals, untyped, with_types

FIELDS = {'position': 'position', 'speed': 'velocity', 'current': 'effort'}
"""Signal to the field of `JointState` that carries its prediction; effort holds the current, A."""


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
        self._sources = s.sources()
        self._pipeline: Pipeline | None = None
        self._topics: list[RawTopic] = []
        self._worker = RefitWorker()
        self._fitted: RefitOutcome | None = None
        self._next_refit = 0
        self._next_look = 0.0
        self._advertise()
        self._publish_model()
        if s.refit_period:
            self._worker.start()
        self._connect()
        names = ', '.join(topic.resolved for topic in self._topics) or 'topics yet to appear'
        self.get_logger().info(f'{s.estimator} on {names}')

    def _connect(self) -> None:
        """Listen, as soon as the types of all topics are known."""
        here = dict(self.get_topic_names_and_types())
        asked = untyped(self._sources, self._configuration.wanted())
        found = {t: here[n][0] for t in asked if (n := self.resolve_topic_name(t)) in here}
        if asked - set(found):
            return
        plan = plan_signals(with_types(self._sources, found), self._configuration.wanted())
        readers = [topic.reader(installed_types(topic.message_type)) for topic in plan.topics]
        self._pipeline = self._configuration.pipeline(
            plan, readers, self.settings.value.window_samples
        )
        self._topics = [RawTopic(self, topic.topic, topic.message_type) for topic in plan.topics]
        self._health = Health(self._pipeline, self._topics)

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
        if self._pipeline is not None:
            with self._health.timed() as batch:
                batch.waiting = self.hurry
                batch.messages = self._take(self._pipeline)
                batch.taken = time.perf_counter()
                for event in self._pipeline.advance(self.settings.value.time_budget):
                    self._publish(event)
            self.hurry = self._pipeline.collect() > 0
        self._look()

    def _take(self, pipeline: Pipeline) -> int:
        count = 0
        for k, topic in enumerate(self._topics):
            for message in topic.drain():
                pipeline.push(k, message.data, message.received)
                count += 1
        return count

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
        record = self._pipeline.record(s.refit_window) if self._pipeline else None
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
        if self._pipeline is None:
            self._connect()
            return
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
        if self._pipeline is not None:
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
