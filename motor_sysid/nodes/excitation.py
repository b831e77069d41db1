"""The `excitation` node: runs a profile live, and stops safe when a limit is passed."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
import math
import time

from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from motor_sysid.control.profile import Profile, PROFILES, SPEED
from motor_sysid.control.profile_file import load_profile
from motor_sysid.errors import UserError
from motor_sysid.nodes.excitation_watch import Bounds, Watch
from motor_sysid.nodes.grid import SampleGrid
from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.loop import LoopNode
from motor_sysid.nodes.loop import main as run
from motor_sysid.nodes.parameters import as_path, parameter, Settings
from motor_sysid.nodes.publishing import DiagnosticsPublisher, SECOND, vector_publisher
from motor_sysid.nodes.statuses import Status
from motor_sysid.recording.field_reader import FieldReader

VECTOR, JOINT = 'geometry_msgs/msg/Vector3Stamped', 'sensor_msgs/msg/JointState'
ROUTES = {
    SPEED: ('motor/reference', 'speed'),
    'voltage': ('motor/voltage_command', 'dc'),
    'current': ('motor/current_command', 'q'),
}
"""Signal of a profile to the topic that carries it in SI, and its ``frame_id``."""
FAREWELLS = 5
"""How often zero is sent at the end: a best-effort reader may miss some."""
REPORT = 1.0
"""Time between two reports in /diagnostics, s."""
BURST = 100
"""Most samples published in one step of the loop."""


@dataclass(frozen=True)
class ExcitationSettings:
    """Parameters of the node."""

    profile: str = parameter(
        'steps', 'Profile file (YAML or CSV, as `motor-sysid suggest` writes it), or the name of '
        'a built-in profile.',
    )  # fmt: skip
    level: float = parameter(50.0, 'Largest speed of a built-in profile.', 'rad/s', 0, 1e5)
    duration: float = parameter(10.0, 'Duration of a built-in profile.', 's', 0.1, 1e5)
    rate: float = parameter(500.0, 'Samples per second.', 'Hz', 10, 2000)
    autostart: bool = parameter(
        False, 'Start with the first sample of motor/speed, not with the service ~/start.'
    )
    input_limit: float = parameter(
        0.0, 'Largest input sent; 0 for that of the profile file, or none.', 'V or A', 0, 1000
    )
    speed_limit: float = parameter(
        0.0, 'Measured speed that ends the run; 0 as above.', 'rad/s', 0, 1e5
    )
    current_limit: float = parameter(
        0.0, 'Measured current that ends the run; 0 as above.', 'A', 0, 1e4
    )
    travel_limit: float = parameter(
        0.0, 'Measured distance from the start that ends the run; 0 as above.', 'rad', 0, 1e7
    )
    feedback_timeout: float = parameter(
        0.5, 'Silence of a topic whose limit is watched that ends the run.', 's', 0.02, 60
    )

    def plan(self) -> tuple[Profile, dict[str, float]]:
        """Return the profile and its limits, of which those given as parameters go first.

        Raises
        ------
        UserError
            If there is no such file or profile, or nobody takes its signal.
        """
        limits: dict[str, float] = {}
        if self.profile in PROFILES:
            profile = Profile(self.profile, self.level, self.duration)
        elif (path := as_path(self.profile)).is_file():
            profile, limits = load_profile(path)
        else:
            raise UserError(
                f'no profile `{self.profile}`: neither a file nor one of {", ".join(PROFILES)}'
            )
        if profile.signal not in ROUTES:
            raise UserError(
                f'profile `{profile.name}` is a {profile.signal} in {profile.unit}, which no '
                f'topic carries to a motor; live it can be {", ".join(ROUTES)}. '
                '`motor-sysid simulate --profile` runs it on a model'
            )
        given = {
            'input': self.input_limit, 'speed': self.speed_limit,
            'current': self.current_limit, 'travel': self.travel_limit,
        }  # fmt: skip
        return profile, {**limits, **{name: v for name, v in given.items() if v > 0}}


class State(Enum):
    """What the node is doing."""

    WAITING = 'waits for ~/start'
    RUNNING = 'running'
    DONE = 'done'
    STOPPED = 'stopped'


class ExcitationNode(LoopNode):
    """Publishes a profile on the topic of its signal, each sample at its stamp.

    Nothing is published before the start; at the end, however it comes about, zero is.
    """

    def __init__(
        self, context: Context | None = None, overrides: Sequence[Parameter] = ()
    ) -> None:
        super().__init__('excitation', context, overrides)
        self.settings = Settings(self, ExcitationSettings)
        s = self.settings.value
        self.period = 1 / s.rate
        self.profile, limits = s.plan()
        self._limit = limits.get('input', math.inf)
        watched = {name: limits[name] for name in ('speed', 'current', 'travel') if name in limits}
        self._bounds = Bounds(**watched, timeout=s.feedback_timeout)
        topic, frame = ROUTES[self.profile.signal]
        self._output = vector_publisher(self, topic, frame)
        self._topic = self.resolve_topic_name(topic)
        self._speed, self._current = (
            RawTopic(self, 'motor/speed', JOINT), RawTopic(self, 'motor/current', VECTOR)
        )  # fmt: skip
        self._read_speed = FieldReader(JOINT, ('velocity[0]', 'position[0]')).read
        self._read_current = FieldReader(VECTOR, ('vector.x', 'vector.y', 'vector.z')).read
        self._diagnostics = DiagnosticsPublisher(self, '/diagnostics', QoSProfile(depth=10))
        self.state, self.reason = State.WAITING, ''
        self._grid, self._watch = SampleGrid(self, s.rate), Watch(self._bounds, 0.0)
        self._began = self._elapsed = 0.0
        self._next_report = 0.0
        self.create_service(Trigger, '~/start', self._on_start)
        self.create_service(Trigger, '~/stop', self._on_stop)
        self.get_logger().info(
            f'{self.profile.name} of {self.profile.duration:g} s on {self._topic} '
            f'{State.WAITING.value}'
        )

    def step(self) -> None:
        """Look at the limits, and publish what is due."""
        trouble = self._look()
        if self.state is State.RUNNING:
            if trouble:
                self._end(State.STOPPED, trouble)
            else:
                self._publish_due()
        now = time.monotonic()
        if now >= self._next_report:
            self._next_report = now + REPORT
            self._speed.adapt()
            self._current.adapt()
            self._report()

    def close(self) -> None:
        """Leave the motor at zero if it is still driven from here."""
        if self.state is State.RUNNING:
            self._end(State.STOPPED, 'the node was ended')
            self._output.publisher.wait_for_all_acked(Duration(seconds=0.5))

    def _look(self) -> str:
        """Take in what was measured; return what is wrong, or nothing."""
        now, wrong = time.monotonic(), []
        messages = self._speed.drain()
        if messages and self.state is State.WAITING and self.settings.value.autostart:
            self._start_by_itself()
        for message in messages:
            speed, position = self._read_speed(message.data)
            wrong.append(self._watch.moved(now, float(speed), float(position)))
        for message in self._current.drain():
            largest = max(map(float, self._read_current(message.data)), key=abs)
            wrong.append(self._watch.flowed(now, largest))
        return next(filter(None, wrong), self._watch.silent(now))

    def _publish_due(self) -> None:
        due = self._grid.due(self._grid.now())
        if self._grid.restarts:
            self._end(State.STOPPED, 'time fell back by more than a second')
            return
        for _ in range(min(due, BURST)):
            stamp = self._grid.stamp
            if not self._began:
                self._began = stamp
            self._elapsed = (stamp - self._began) / SECOND
            if self._elapsed >= self.profile.duration:
                self._end(State.DONE, f'the profile of {self.profile.duration:g} s is over')
                return
            value = self.profile(self._elapsed)
            if self.profile.signal != SPEED:
                value = min(max(value, -self._limit), self._limit)
            self._output.publish(stamp, value, 0.0, 0.0)
            self._grid.advance()

    def _start_by_itself(self) -> None:
        """Start, or go on waiting and say why."""
        reason = self._begin()
        if reason and reason != self.reason:
            self.get_logger().warning(reason)
        self.reason = reason

    def _begin(self) -> str:
        """Start from the beginning; return why not, or nothing."""
        others = self.count_publishers(self._topic) - 1
        if others > 0:
            return (
                f'{others} more publish on {self._topic}: end them first, or the motor hears two '
                'masters'
            )
        self._grid = SampleGrid(self, self.settings.value.rate)
        self._speed.drain()
        self._current.drain()
        self._watch = Watch(self._bounds, time.monotonic())
        self._began = self._elapsed = 0.0
        self._change(State.RUNNING, '')
        return ''

    def _end(self, state: State, reason: str) -> None:
        """Send zero, and go on sending nothing."""
        stamp = self._grid.stamp
        for k in range(FAREWELLS):
            self._output.publish(stamp + k * SECOND // 1000, 0.0, 0.0, 0.0)
        self._change(state, reason)

    def _change(self, state: State, reason: str) -> None:
        self.state, self.reason = state, reason
        text = f'{state.value}{": " if reason else ""}{reason}'
        if state is State.STOPPED:
            self.get_logger().warning(text)
        else:
            self.get_logger().info(text)
        self._report()

    def _report(self) -> None:
        values: dict[str, object] = {
            'state': self.state.name.lower(),
            'profile': self.profile.name,
            'signal': self.profile.signal,
            'elapsed_s': self._elapsed,
            'duration_s': self.profile.duration,
        }
        text, warn = self.reason or self.state.value, self.state is State.STOPPED
        if self.state is State.RUNNING and not self.count_subscribers(self._topic):
            text, warn = f'nobody listens to {self._topic}', True
        status = Status(self.full_name, values, text, warn=warn)
        self._diagnostics.publish(self._grid.now(), [status])

    def _on_start(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.state is State.RUNNING:
            response.success, response.message = False, 'running already'
            return response
        reason = self._begin()
        response.success, response.message = not reason, reason or 'started'
        return response

    def _on_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.state is State.RUNNING:
            self._end(State.STOPPED, 'asked to stop')
        response.success, response.message = True, 'stopped at zero'
        return response


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run(ExcitationNode, args)


if __name__ == '__main__':
    raise SystemExit(main())
