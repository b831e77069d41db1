"""Watch a running loop from outside: speed, tracking, estimates, prediction errors."""

from collections import deque
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
import math
import time
from types import TracebackType

from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.utilities import try_shutdown
from std_srvs.srv import Trigger

from motor_sysid.errors import UserError
from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.publishing import SECOND
from motor_sysid.recording.field_reader import FieldReader

VECTOR, JOINT = 'geometry_msgs/msg/Vector3Stamped', 'sensor_msgs/msg/JointState'
STAMP = ('header.stamp.sec', 'header.stamp.nanosec')

LISTENERS = {
    '/motor/voltage': ('identifier', 'recorder'),
    '/motor/current': ('identifier', 'recorder'),
    '/motor/speed': ('identifier', 'recorder', 'pid'),
    '/motor/reference': ('recorder',),
    '/identifier/estimate': ('recorder',),
    '/identifier/model': ('recorder',),
    '/identifier/diagnosis': ('recorder',),
}
"""Who must listen to what before the loop may start, besides the motor to its command."""


@dataclass(frozen=True)
class Estimated:
    """One live estimate: value and standard deviation in its unit, and whether it is one."""

    value: float
    sigma: float
    unit: str
    identifiable: bool


@dataclass(frozen=True)
class Snapshot:
    """What is seen now.

    Attributes
    ----------
    elapsed:
        Sample time since the profile began, s.
    speed, reference:
        rad/s.
    tracking:
        RMS of reference minus speed over the last second, rad/s.
    errors:
        Field of ~/residual (velocity, effort: the current) to its RMS over the last 2 s or so.
    estimates:
        By parameter.
    verdict:
        What the last diagnosis of the running identifier said, in one line; empty before any.
    """

    elapsed: float = 0.0
    speed: float = math.nan
    reference: float = 0.0
    tracking: float = math.nan
    errors: Mapping[str, float] = field(default_factory=dict)
    estimates: Mapping[str, Estimated] = field(default_factory=dict)
    verdict: str = ''


class Monitor:
    """A node of its own that only listens, and starts the profile.

    Use as a context manager; it has its own ROS context.

    Parameters
    ----------
    command:
        What the motor is told: ``voltage`` or ``current``.
    """

    def __init__(self, command: str = 'voltage') -> None:
        self._listeners = {**LISTENERS, f'/motor/{command}_command': ('motor', 'recorder')}
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node('motor_sysid_monitor', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        few = QoSProfile(depth=1000)
        self._speed = RawTopic(self._node, '/motor/speed', JOINT, few)
        self._reference = RawTopic(self._node, '/motor/reference', VECTOR, few)
        self._estimate = RawTopic(
            self._node, '/identifier/estimate', 'diagnostic_msgs/msg/DiagnosticArray', few
        )
        self._residual = RawTopic(self._node, '/identifier/residual', JOINT, few)
        self._diagnosis = RawTopic(
            self._node, '/identifier/diagnosis', 'diagnostic_msgs/msg/DiagnosticArray', few
        )
        self._health = RawTopic(
            self._node, '/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', few
        )
        self._recorded: Mapping[str, str] = {}
        self._read_speed = FieldReader(JOINT, (*STAMP, 'velocity[0]')).read
        self._read_reference = FieldReader(VECTOR, (*STAMP, 'vector.x')).read
        self._read_residual = FieldReader(JOINT, ('velocity[0]', 'effort[0]')).read
        self._speeds: dict[int, float] = {}
        self._errors: deque[float] = deque(maxlen=500)
        self._residuals: deque[tuple[float, ...]] = deque(maxlen=100)
        self._first: int | None = None
        self._seen = Snapshot()

    def __enter__(self) -> 'Monitor':
        """Return the monitor."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave ROS."""
        self._executor.shutdown()
        self._node.destroy_node()
        try_shutdown(context=self._context)

    def unheard(self, but: Collection[str] = ()) -> list[str]:
        """Return what still hinders the start, as ``node does not listen to topic``.

        Who listens need not be heard by the publisher yet, so the recorder must also have got
        something of what the identifier is given.  Topics in `but` need not be heard yet.
        """
        for message in self._health.drain():
            self._recorded = _values(message.data, 'recorder') or self._recorded
        missing = []
        for topic, names in self._listeners.items():
            if topic in but:
                continue
            there = {info.node_name for info in self._node.get_subscriptions_info_by_topic(topic)}
            missing += [
                f'{name} does not listen to {topic}' for name in names if name not in there
            ]
            if 'identifier' in names and self._recorded.get(topic, '0') == '0':
                missing.append(f'recorder has heard nothing on {topic}')
        return missing

    def wait_until_heard(
        self, check: Callable[[], None], but: Collection[str] = (), patience: float = 60.0
    ) -> None:
        """Wait until every node hears what it must.

        Parameters
        ----------
        check:
            Called all the time; raises if there is no use in waiting.
        but:
            Topics that need not be heard yet.
        patience:
            Longest wait, s.

        Raises
        ------
        UserError
            If it takes too long; says which node hears what not.
        """
        end = time.monotonic() + patience
        while missing := self.unheard(but):
            check()
            if time.monotonic() > end:
                raise UserError(f'the nodes did not find each other in {patience:g} s: {missing}')
            self._executor.spin_once(timeout_sec=0.05)

    def start_profile(self, check: Callable[[], None]) -> None:
        """Have the identifier start anew and the controller start its profile.

        Whatever the identifier is given from here on is recorded too, so that a replay of the bag
        can give the same estimates.
        """
        self.call('/identifier/reset', check)
        self.call('/pid/start', check)
        self._reference.drain()  # zeros from before the start

    def call(self, service: str, check: Callable[[], None], patience: float = 20.0) -> None:
        """Call a service without arguments and wait for its answer.

        Raises
        ------
        UserError
            If there is none.
        """
        client = self._node.create_client(Trigger, service)
        end = time.monotonic() + patience
        future = None
        while future is None or not future.done():
            check()
            if time.monotonic() > end:
                raise UserError(f'{service} did not answer in {patience:g} s; see the logs')
            if future is None and client.service_is_ready():
                future = client.call_async(Trigger.Request())
            self._executor.spin_once(timeout_sec=0.05)

    def look(self) -> Snapshot:
        """Take what has come and return what is seen now."""
        for message in self._speed.drain():
            seconds, nanoseconds, speed = self._read_speed(message.data)
            self._speeds[int(seconds) * SECOND + int(nanoseconds)] = float(speed)
        self._look_at_reference()
        for message in self._residual.drain():
            self._residuals.append(tuple(map(float, self._read_residual(message.data))))
        estimates, verdicts = self._estimate.drain()[-1:], self._diagnosis.drain()[-1:]
        self._seen = replace(
            self._seen,
            speed=next(reversed(self._speeds.values()), math.nan),
            tracking=_rms(list(self._errors)),
            errors={
                name: _rms([row[k] for row in self._residuals])
                for k, name in enumerate(('velocity', 'effort'))
            },
            estimates=_estimates(estimates[0].data) if estimates else self._seen.estimates,
            verdict=_verdict(verdicts[0].data) if verdicts else self._seen.verdict,
        )
        return self._seen

    def _look_at_reference(self) -> None:
        """Pair references with the speeds of the same stamps."""
        elapsed, reference = self._seen.elapsed, self._seen.reference
        for message in self._reference.drain():
            seconds, nanoseconds, value = self._read_reference(message.data)
            stamp, reference = int(seconds) * SECOND + int(nanoseconds), float(value)
            self._first = stamp if self._first is None else self._first
            elapsed = (stamp - self._first) / SECOND
            if stamp in self._speeds:
                self._errors.append(reference - self._speeds[stamp])
        for stamp in list(self._speeds)[:-2000]:
            del self._speeds[stamp]
        self._seen = replace(self._seen, elapsed=elapsed, reference=reference)


def _values(data: bytes, name: str) -> dict[str, str]:
    message = deserialize_message(data, DiagnosticArray)
    found = [status.values for status in message.status if status.name == name]
    return {str(pair.key): str(pair.value) for values in found for pair in values}


def _verdict(data: bytes) -> str:
    message = deserialize_message(data, DiagnosticArray)
    return next((str(status.message) for status in message.status if status.name == 'verdict'), '')


def _estimates(data: bytes) -> dict[str, Estimated]:
    message = deserialize_message(data, DiagnosticArray)
    found = {}
    for status in message.status:
        values = {pair.key: pair.value for pair in status.values}
        if 'sigma' in values:
            found[status.name] = Estimated(
                float(values['value']), float(values['sigma']), values['unit'],
                values['identifiable'] == 'True',
            )  # fmt: skip
    return found


def _rms(values: list[float]) -> float:
    finite = [value for value in values if math.isfinite(value)]
    return math.sqrt(sum(v * v for v in finite) / len(finite)) if finite else math.nan
