"""Take messages in batches as raw bytes, beside the executor, and count what is lost."""

from collections.abc import Mapping
import importlib
import time
from typing import Any, NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from motor_sysid.errors import UserError
from motor_sysid.nodes.publishing import DEPTH

BATCH = 1000
"""Most messages taken from one topic at once, so that one busy topic cannot starve the rest."""


class Unspun(CallbackGroup):
    """A callback group that no executor ever runs: its subscriptions are drained by hand.

    A message through an executor costs 0.1 to 0.6 ms; taken raw in a batch, 2 to 5 us.
    """

    def can_execute(self, entity: object) -> bool:
        """Refuse; an executor then does not wait for the entity either."""
        return False

    def beginning_execution(self, entity: object) -> bool:
        """Refuse."""
        return False

    def ending_execution(self, entity: object) -> None:
        """Do nothing."""


class RawMessage(NamedTuple):
    """One message as it came: CDR bytes, receive time in ns, and the writer's count, if it has."""

    data: bytes
    received: int
    sequence: int | None

    @classmethod
    def of(cls, data: bytes, info: Mapping[str, int | None]) -> 'RawMessage':
        """Return what rclpy took; not every middleware tells the time or counts (CycloneDDS)."""
        received = info['received_timestamp'] or time.time_ns()
        return cls(data, received, info['publication_sequence_number'])


def message_class(name: str) -> Any:  # noqa: ANN401 - generated classes have no common type
    """Return the Python class of a message type such as ``sensor_msgs/msg/JointState``.

    Raises
    ------
    UserError
        If it is not installed.
    """
    package, _, kind = name.partition('/msg/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), kind)
    except (ImportError, AttributeError, ValueError):
        raise UserError(
            f'message type `{name}` is not installed; install or source the package `{package}`'
        ) from None


class RawTopic:
    """One subscription, drained by hand.

    Parameters
    ----------
    node:
        Its node.
    topic, message_type:
        Name (may be remapped) and type.
    qos:
        Wanted quality of service; by default reliable with a deep queue.

    Attributes
    ----------
    received, lost:
        Messages taken, and messages that the writer numbered but that never came; none where the
        middleware does not tell the numbers.
    """

    def __init__(
        self, node: Node, topic: str, message_type: str, qos: QoSProfile | None = None
    ) -> None:
        self._node = node
        self.topic, self.message_type = topic, message_type
        self._class = message_class(message_type)
        self.received = self.lost = 0
        self._heads: list[int] = []
        self._subscribe(qos or QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE))

    def _subscribe(self, qos: QoSProfile) -> None:
        self.qos = qos
        self._subscription: Subscription = self._node.create_subscription(
            self._class, self.topic, _never, qos, callback_group=Unspun(), raw=True
        )
        self.resolved: str = self._subscription.topic_name

    def drain(self, limit: int = BATCH) -> list[RawMessage]:
        """Take what has come, at most `limit` messages."""
        messages: list[RawMessage] = []
        handle = self._subscription.handle
        with handle:
            while len(messages) < limit:
                taken = handle.take_message(self._class, True)
                if taken is None:
                    break
                messages.append(RawMessage.of(*taken))
        self._count(messages)
        return messages

    def _count(self, messages: list[RawMessage]) -> None:
        self.received += len(messages)
        for sequence in (m.sequence for m in messages if m.sequence is not None):
            if sequence - 1 in self._heads:
                self._heads.remove(sequence - 1)
            else:
                self._note_jump(sequence)
            self._heads.append(sequence)

    def _note_jump(self, sequence: int) -> None:
        """Tell a loss from a writer that was not heard before: each counts its own messages."""
        behind = [last for last in self._heads if last < sequence]
        if behind and len(self._heads) >= self.publishers:
            self.lost += sequence - max(behind) - 1
            self._heads.remove(max(behind))

    @property
    def publishers(self) -> int:
        """Number of matched publishers."""
        with self._subscription.handle:
            return int(self._subscription.handle.get_publisher_count())

    def adapt(self) -> bool:
        """Subscribe anew if a publisher offers less than is wanted; tell whether that was so.

        A best-effort publisher never connects to a reliable subscription, and says nothing.
        """
        offered = self._node.get_publishers_info_by_topic(self.resolved)
        wanted = adapted_qos([info.qos_profile for info in offered], self.qos)
        if wanted.reliability == self.qos.reliability and wanted.durability == self.qos.durability:
            return False
        self._node.destroy_subscription(self._subscription)
        self._heads = []
        self._subscribe(wanted)
        return True

    def destroy(self) -> None:
        """Unsubscribe."""
        self._node.destroy_subscription(self._subscription)


def adapted_qos(offered: list[QoSProfile], wanted: QoSProfile) -> QoSProfile:
    """Return what every publisher can serve, as rosbag2 does: the weakest of what they offer."""
    if not offered:
        return wanted
    reliable = all(q.reliability == ReliabilityPolicy.RELIABLE for q in offered)
    kept = all(q.durability == DurabilityPolicy.TRANSIENT_LOCAL for q in offered)
    return QoSProfile(
        depth=wanted.depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
    )


def _never(message: object) -> None:
    raise AssertionError('this subscription is drained by hand')
