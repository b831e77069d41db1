"""The reference that others give: the last one, as long as somebody is there to give the next."""

import math
import time

from rclpy.node import Node

from motor_sysid.nodes.intake import RawTopic
from motor_sysid.recording.field_reader import FieldReader

VECTOR = 'geometry_msgs/msg/Vector3Stamped'
LOOK = 0.1
"""Time between two looks for a publisher, s."""


class GivenReference:
    """Listens to `motor/reference`.

    One message is enough: it holds as long as its publisher is there.  Once nobody publishes any
    more (the process has ended or died), the reference goes to 0.

    Parameters
    ----------
    node:
        Its node.

    Attributes
    ----------
    value:
        The reference; 0 before the first message.
    """

    def __init__(self, node: Node) -> None:
        self._node, self._topic = node, RawTopic(node, 'motor/reference', VECTOR)
        self._read = FieldReader(VECTOR, ('vector.x',)).read
        self._next_look, self._given = 0.0, math.inf
        self.value = 0.0

    def look(self, timeout: float) -> None:
        """Take what has come; without a publisher for `timeout` s (0: for ever) it is 0."""
        now = time.monotonic()
        for message in self._topic.drain()[-1:]:
            value = float(self._read(message.data)[0])
            self.value, self._given = value if math.isfinite(value) else 0.0, now
        if now < self._next_look:
            return
        self._next_look = now + LOOK
        if self._node.count_publishers(self._topic.resolved):
            self._given = now
        elif self.value and timeout and now - self._given > timeout:
            self.value = 0.0
            self._node.get_logger().warning(
                f'nobody publishes {self._topic.resolved} any more: the reference is 0; keep its '
                'publisher running, or set `reference_timeout` to 0'
            )

    def adapt(self) -> None:
        """Listen as its publishers offer it."""
        self._topic.adapt()

    def destroy(self) -> None:
        """Unsubscribe."""
        self._topic.destroy()
