"""The `recorder` node: raw messages straight into a rosbag2 bag that survives a kill."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
import time

from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile

from motor_sysid.errors import UserError
from motor_sysid.nodes.bag_thread import BagThread
from motor_sysid.nodes.intake import adapted_qos, RawTopic
from motor_sysid.nodes.loop import LoopNode
from motor_sysid.nodes.loop import main as run
from motor_sysid.nodes.message_types import own_definition
from motor_sysid.nodes.parameters import as_path, parameter, Settings
from motor_sysid.nodes.publishing import DEPTH, DiagnosticsPublisher, now_ns
from motor_sysid.nodes.statuses import Status
from motor_sysid.recording.writer import BagWriter, STORAGES

TOPICS = (
    'motor/voltage', 'motor/current', 'motor/speed', 'motor/reference', 'motor/voltage_command',
    'motor/current_command',
    'identifier/estimate', 'identifier/model', 'identifier/diagnosis', 'identifier/prediction',
    'identifier/residual', '/diagnostics',
)  # fmt: skip
LOOK, CALM = 0.2, 1.0
"""Time between two looks for new topics, as long as some are missing and after that, s."""
TIMELESS = 'nothing was heard on /clock, which `use_sim_time` asks for'


@dataclass(frozen=True)
class RecorderSettings:
    """Parameters of the node."""

    path: str = parameter('', 'Folder of the new bag; empty for one named by date and time.')
    storage: str = parameter(
        'sqlite3', 'Storage of the bag; either can be read after a kill.', choices=tuple(STORAGES)
    )
    topics: tuple[str, ...] = parameter(TOPICS, 'Topics to record; each as soon as it appears.')
    all_topics: bool = parameter(False, 'Record every topic there is, not those listed.')
    drain_period: float = parameter(0.01, 'Messages are taken this often.', 's', 0.001, 0.5)


class RecorderNode(LoopNode):
    """Records topics with the QoS that their publishers offer and the times of reception.

    These are simulated times where the node follows /clock: what comes before it begins waits in
    the queues of the subscriptions, and is received when it does.
    """

    def __init__(
        self, context: Context | None = None, overrides: Sequence[Parameter] = ()
    ) -> None:
        super().__init__('recorder', context, overrides)
        self.settings = Settings(self, RecorderSettings)
        s = self.settings.value
        self.period = s.drain_period
        self._wanted = [self.resolve_topic_name(topic) for topic in s.topics]
        self._topics: dict[str, RawTopic] = {}
        self._refused: set[str] = set()
        self._next_look = self._next_report = 0.0
        self._diagnostics = DiagnosticsPublisher(self, '/diagnostics', QoSProfile(depth=10))
        self._simulated = bool(self.get_parameter('use_sim_time').value)
        name = s.path or f'bag_{datetime.now().astimezone():%Y%m%d_%H%M%S}'
        self._path = as_path(name).resolve()
        self._bag = BagThread(lambda: BagWriter(self._path, s.storage))
        self.get_logger().info(f'recording to {self._path}')

    def step(self) -> None:
        """Write what has come; look for new topics now and then."""
        self._write()
        now = time.monotonic()
        if now >= self._next_look:
            self._discover()
            missing = self.settings.value.all_topics or len(self._topics) < len(self._wanted)
            self._next_look = now + (LOOK if missing else CALM)
        if now >= self._next_report:
            self._next_report = now + 1.0
            self._report()

    def close(self) -> None:
        """Write what has come up to now and close the bag."""
        try:
            self._write()
        finally:
            self._bag.close()
        if self._timeless:
            self.get_logger().warning(f'{TIMELESS}, so nothing was recorded')
        self.get_logger().info(
            f'{self._bag.written} messages on {len(self._topics)} topics, {self._lost()} lost: '
            f'{self._path}'
        )

    @property
    def _timeless(self) -> bool:
        """Whether simulated time has not begun."""
        return self._simulated and now_ns(self.get_clock()) <= 0

    def _write(self) -> None:
        if self._timeless:
            return
        now = now_ns(self.get_clock()) if self._simulated else 0
        for topic in self._topics.values():
            if messages := topic.drain():
                self._bag.write(topic.resolved, [(now or m.received, m.data) for m in messages])

    def _discover(self) -> None:
        for name, types in self.get_topic_names_and_types():
            if name in self._topics or name in self._refused:
                continue
            if self.settings.value.all_topics or name in self._wanted:
                self._add(name, types[0])

    def _add(self, name: str, message_type: str) -> None:
        """Record a topic from now on, if someone publishes it and its type is known."""
        publishers = self.get_publishers_info_by_topic(name)
        if not publishers:
            return
        offered = [info.qos_profile for info in publishers]
        qos = adapted_qos(offered, QoSProfile(depth=DEPTH))
        try:
            definition = own_definition(message_type)
            topic = RawTopic(self, name, message_type, qos)
        except UserError as error:
            self._refuse(name, str(error))
            return
        digest = str(publishers[0].topic_type_hash)
        reason = self._bag.add_topic(name, message_type, offered, definition, digest)
        if reason:
            topic.destroy()
            self._refuse(name, reason)
            return
        self._topics[name] = topic
        self.get_logger().info(f'{name} [{message_type}]')

    def _refuse(self, name: str, reason: str) -> None:
        self._refused.add(name)
        self.get_logger().warning(f'{name} is not recorded: {reason}')

    def _report(self) -> None:
        for topic in self._topics.values():
            topic.adapt()
        self._bag.flush()
        values: dict[str, object] = {
            'messages': self._bag.written,
            'topics': len(self._topics),
            'lost': self._lost(),
            **{topic.resolved: topic.received for topic in self._topics.values()},
        }
        lost = 'messages were lost' if values['lost'] else ''
        trouble = TIMELESS if self._timeless else lost
        status = Status(self.full_name, values, trouble or 'ok', warn=bool(trouble))
        self._diagnostics.publish(now_ns(self.get_clock()), [status])

    def _lost(self) -> int:
        return sum(topic.lost for topic in self._topics.values())


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run(RecorderNode, args)


if __name__ == '__main__':
    raise SystemExit(main())
