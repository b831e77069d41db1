"""The `identifier` node: live estimates, predictions, refits, diagnoses, a model to edit."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
import threading
import time

from diagnostic_msgs.srv import AddDiagnostics
from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from motor_sysid.errors import UserError
from motor_sysid.estimation.stream import Event
from motor_sysid.nodes.condition import ConditionWatch
from motor_sysid.nodes.configuration import Configuration
from motor_sysid.nodes.editing import edited
from motor_sysid.nodes.health import Health
from motor_sysid.nodes.identifier_settings import IdentifierSettings
from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.long_work import LongWork
from motor_sysid.nodes.loop import LoopNode, wait_for
from motor_sysid.nodes.loop import main as run
from motor_sysid.nodes.message_types import installed_types
from motor_sysid.nodes.parameters import Settings
from motor_sysid.nodes.pipeline import Pipeline
from motor_sysid.nodes.preparation import Preparation
from motor_sysid.nodes.publishing import (
    DEPTH,
    DiagnosticsPublisher,
    joint_publisher,
    LATCHED,
    now_ns,
    PackedPublisher,
)
from motor_sysid.nodes.search import Search
from motor_sysid.nodes.statuses import (
    diagnosis_statuses,
    diagnosis_summary,
    estimate_statuses,
    fit_statuses,
    Status,
    under,
)
from motor_sysid.nodes.topics import sources_of

FIELDS = {
    'position': 'position', 'speed': 'velocity', 'current': 'effort', 'current_q': 'effort',
    'current_a': 'effort',
}  # fmt: skip
"""Signal to the field of `JointState` that carries its prediction; effort holds a current, A."""

Sending = Callable[[], None]

MOST_WAITING = 8
"""Messages that may wait to be published; with more, a step publishes all above it."""

SILENCE = 3.0
"""Seconds of compiling after which the node says so."""

COMPILING = (
    'compiling for this motor and estimator; the first start on a machine takes a minute, the '
    'next ones do not. `motor-sysid compile` does it beforehand'
)

TAKEN = 2
"""Most messages taken from one topic in a step: after a stall the backlog comes in pieces."""


class IdentifierNode(LoopNode):
    """Takes three topics in batches, joins them on their stamps and feeds the estimator.

    What is published on ``~/estimate`` depends on the samples and on what is published on
    ``~/model`` as ``configuration`` alone, so that a replay gives the same estimates; refits and
    diagnoses run in a process of their own, on real data at whatever time.
    """

    def __init__(
        self, context: Context | None = None, overrides: Sequence[Parameter] = ()
    ) -> None:
        super().__init__('identifier', context, overrides)
        self.settings = Settings(self, IdentifierSettings)
        s = self.settings.value
        self.period = s.drain_period
        messages = s.messages()
        self._search = Search(self, sources_of(messages), messages.base_clock)
        with self._patience():
            first = Preparation(s.configuration, 0.0)
            wait_for(lambda: first.running)
        self._configuration = first.configuration()
        self._condition = ConditionWatch(s)
        self._next: Configuration | None = None
        self._prepared: Preparation | None = None
        self._show_effects()
        self.settings.test_change(self._prepare)
        self.settings.on_change(self._hand_over)
        self._pipeline: Pipeline | None = None
        self._topics: list[RawTopic] = []
        self._outbox: deque[Sending] = deque()
        self._work = LongWork(self.get_logger(), s.effect_files)
        self._next_look, self._doubts, self._rows_of = 0.0, set[str](), ''
        self._advertise()
        self._publish_model(now_ns(self.get_clock()))
        if s.refit_period or s.diagnose_period:
            self._work.start()
        self._connect()
        names = ', '.join(topic.resolved for topic in self._topics) or 'topics yet to appear'
        self.get_logger().info(f'{s.estimator} on {names}')

    @contextmanager
    def _patience(self) -> Iterator[None]:
        """Say why it takes long, if it does: the first start of a kind has to compile."""
        said = threading.Timer(SILENCE, self.get_logger().warning, [COMPILING])
        said.start()
        try:
            yield
        finally:
            said.cancel()

    def _connect(self) -> bool:
        """Listen, as soon as it is known to what; tell whether it is."""
        plan = self._search.plan(self._configuration)
        if plan is None:
            return False
        if plan.by_reception and self.get_parameter('use_sim_time').value:
            raise UserError(
                f'`stamp: receive` of {plan.by_reception} is the time of reception, not that of '
                '/clock, which `use_sim_time` asks for: every rate would be wrong. Give the path '
                'of a stamp in the messages; a simulation that keeps pace needs no `use_sim_time`'
            )
        readers = [topic.reader(installed_types(topic.message_type)) for topic in plan.topics]
        self._pipeline = self._configuration.pipeline(
            plan, readers, self.settings.value.window_samples
        )
        self._topics = [RawTopic(self, topic.topic, topic.message_type) for topic in plan.topics]
        self._health = Health(self._pipeline, self._topics)
        return True

    def _advertise(self) -> None:
        deep = QoSProfile(depth=100)
        self._estimate = DiagnosticsPublisher(self, '~/estimate', deep)
        self._model = DiagnosticsPublisher(self, '~/model', LATCHED)
        self._verdict = DiagnosticsPublisher(self, '~/diagnosis', LATCHED)
        self._diagnostics = DiagnosticsPublisher(self, '/diagnostics', QoSProfile(depth=10))
        self._shown = [name for name in FIELDS if name in self._configuration.outputs()]
        self._prediction = self._joint('~/prediction')
        self._residual = self._joint('~/residual')
        self.create_service(Trigger, '~/reset', self._on_reset)
        self.create_service(Trigger, '~/refit', self._on_refit)
        self.create_service(Trigger, '~/diagnose', self._on_diagnose)
        self.create_service(AddDiagnostics, '~/add_effect', self._on_add)
        self.create_service(AddDiagnostics, '~/remove_effect', self._on_remove)

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
                    self._post(event)
                self._send(MOST_WAITING)
            self.hurry = self._pipeline.collect() > 0 or batch.messages >= TAKEN
            if self._next is not None and not self._pipeline.stream.waiting:
                self._adopt(self._next, self._pipeline.stream.changed)
        self._look()

    def _take(self, pipeline: Pipeline, limit: int = TAKEN) -> int:
        """Take at most so many messages of each topic; return how many came."""
        count = 0
        for k, topic in enumerate(self._topics):
            for message in topic.drain(limit):
                pipeline.push(k, message.data, message.received)
                count += 1
        return count

    def close(self) -> None:
        """Publish what waits, and stop the worker."""
        self._send(0)
        self._work.close()

    def _post(self, event: Event) -> None:
        """Line up what an event has to tell."""
        self._health.note(event)
        for publisher, values in (
            (self._prediction, event.prediction), (self._residual, event.residual),
        ):  # fmt: skip
            shown = [values[name] for name in self._shown]
            self._outbox.append(partial(publisher.publish, event.stamp, *shown))
        if event.estimate is not None:
            self._outbox.append(partial(self._tell_estimate, event))
            self._outbox.append(partial(self._ask_for_work, event))

    def _send(self, waiting: int) -> None:
        """Publish one of the messages that wait, and all but `waiting` of them.

        Publishing takes longer than estimating: one at a time, a step stays short.
        """
        while self._outbox:
            self._outbox.popleft()()
            if len(self._outbox) <= waiting:
                break

    def _tell_estimate(self, event: Event) -> None:
        self._estimate.publish(event.stamp, estimate_statuses(event))

    def _ask_for_work(self, event: Event) -> None:
        self._condition.note(event)
        if self._pipeline is not None:
            target = self._next or self._configuration
            self._work.note(event, self._pipeline, target, self.settings.value)

    def _look(self) -> None:
        """Look at what changes slowly."""
        news = self._work.poll()
        if news.fitted:
            self._health.refits += 1
            self._publish_model(now_ns(self.get_clock()))
        if news.diagnosed and self._work.diagnosis is not None:
            outcome = self._work.diagnosis
            self._verdict.publish(outcome.last_stamp, diagnosis_statuses(outcome))
        now = time.monotonic()
        if now < self._next_look:
            return
        self._next_look = now + 1.0
        if self._pipeline is None and self._connect():
            return
        for topic in self._topics:
            if topic.adapt():
                self.get_logger().info(f'{topic.resolved}: now as its publisher offers it')
        statuses = self._intake()
        statuses.append(diagnosis_summary(self._work.diagnosis, self._work.diagnosing))
        statuses += self._condition.statuses()
        self._diagnostics.publish(now_ns(self.get_clock()), under(self.full_name, statuses))

    def _intake(self) -> list[Status]:
        """Return how the samples come and what the model makes of them, or what is waited for."""
        if self._pipeline is None:
            return [Status('intake', {}, self._search.waiting, warn=True)]
        self._tell_of_messages(self._pipeline)
        fitted = self._work.fitted
        return self._health.statuses(fitted.noise if fitted else {})

    def _publish_model(self, stamp: int) -> None:
        statuses = [Status('configuration', self._configuration.to_texts())]
        if self._work.fitted is not None:
            statuses += fit_statuses(self._work.fitted)
        self._model.publish(stamp, statuses)

    def _tell_of_messages(self, pipeline: Pipeline) -> None:
        """Say once what is odd about the messages, and how topics are joined that share none."""
        for doubt in pipeline.doubts:
            if doubt not in self._doubts:
                self._doubts.add(doubt)
                self.get_logger().warning(doubt)
        if pipeline.join.clock != self._rows_of:
            self._rows_of = pipeline.join.clock
            self.get_logger().info(
                f'the stamps of the topics differ: samples are taken at those of {self._rows_of}'
            )

    # --- the effects of the model: services and the parameter `effects` take this one way

    def _prepare(self, settings: IdentifierSettings) -> None:
        """Make the estimator with other effects, or refuse; the samples go on meanwhile."""
        base, pipeline = self._next or self._configuration, self._pipeline
        self._prepared = None
        if set(settings.effects) == set(base.model.effects):
            return
        stream = pipeline.stream if pipeline else None
        estimates = dict(stream.estimate()) if stream and not self._next else {}
        record = pipeline.record(settings.diagnose_window) if pipeline else None
        found = self._work.diagnosis

        def build() -> Configuration:
            return replace(
                base, model=edited(base.model, settings.effects, estimates, found, record)
            )

        preparation = Preparation(build, stream.sample_time if stream else 0.0)
        while preparation.running:
            self.step()
            time.sleep(0.001)
        preparation.configuration()
        self._prepared = preparation

    def _hand_over(self, settings: IdentifierSettings) -> None:
        """Have the prepared estimator take over with the next sample."""
        prepared, self._prepared = self._prepared, None
        if prepared is None:
            return
        if self._pipeline is None:
            self._adopt(prepared.configuration(), 0)
            return
        self._pipeline.stream.change(prepared.make)
        self._next = prepared.configuration()

    def _adopt(self, configuration: Configuration, since: int) -> None:
        """Take a configuration that applies since that stamp, and tell."""
        self._configuration, self._next = replace(configuration, since=since), None
        self._publish_model(since or now_ns(self.get_clock()))
        self._show_effects()
        effects = ', '.join(configuration.model.effects) or 'no effects'
        self.get_logger().info(f'the model has {effects} since stamp {since * 1e-9:.6f} s')

    def _show_effects(self) -> None:
        """Have the parameter say what the model has: one effect may take another's place."""
        effects = self._configuration.model.effects
        if set(self.settings.value.effects) != set(effects):
            self.set_parameters([Parameter('effects', value=list(effects) or [''])])

    def _on_add(
        self, request: AddDiagnostics.Request, response: AddDiagnostics.Response
    ) -> AddDiagnostics.Response:
        key, have = request.load_namespace.strip(), self._effects()
        if key in have:
            response.success, response.message = False, f'the model has `{key}` already'
            return response
        return self._set_effects((*have, key), response)

    def _on_remove(
        self, request: AddDiagnostics.Request, response: AddDiagnostics.Response
    ) -> AddDiagnostics.Response:
        key, have = request.load_namespace.strip(), self._effects()
        if key not in have:
            known = ', '.join(have) or 'none'
            response.success, response.message = False, f'the model has no `{key}`; it has {known}'
            return response
        return self._set_effects(tuple(k for k in have if k != key), response)

    def _effects(self) -> tuple[str, ...]:
        return (self._next or self._configuration).model.effects

    def _set_effects(
        self, effects: Sequence[str], response: AddDiagnostics.Response
    ) -> AddDiagnostics.Response:
        result = self.set_parameters([Parameter('effects', value=list(effects) or [''])])[0]
        response.success, response.message = bool(result.successful), result.reason
        if response.success:
            now = ', '.join(self._effects()) or 'no effects'
            response.message = f'the model has {now}; ~/model says from which sample on'
        return response

    # --- the other services

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._pipeline is not None:
            self._take(self._pipeline, DEPTH)  # what came before the call is no next sample
            self._pipeline.reset()
        self._work.reset()
        response.success, response.message = True, 'starts anew with the next sample'
        return response

    def _on_refit(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._ask('refit', '~/model', response)

    def _on_diagnose(
        self, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        return self._ask('diagnosis', '~/diagnosis', response)

    def _ask(self, kind: str, topic: str, response: Trigger.Response) -> Trigger.Response:
        try:
            target = self._next or self._configuration
            self._work.ask(kind, self._pipeline, target, self.settings.value)
            response.success, response.message = True, f'started; the result comes on {topic}'
        except UserError as error:
            response.success, response.message = False, str(error)
        return response


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run(IdentifierNode, args)


if __name__ == '__main__':
    raise SystemExit(main())
