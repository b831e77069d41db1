"""The `pid` node: speed control, with the reference from a topic or a profile of its own."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
import time

from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from motor_sysid.control.pid import Pid, PidGains
from motor_sysid.control.profile import Profile, PROFILES
from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.loop import LoopNode
from motor_sysid.nodes.loop import main as run
from motor_sysid.nodes.parameters import parameter, Settings
from motor_sysid.nodes.publishing import now_ns, SECOND, vector_publisher
from motor_sysid.nodes.reference import GivenReference
from motor_sysid.recording.field_reader import FieldReader
from motor_sysid.signals.join import RESTART

STAMP = ('header.stamp.sec', 'header.stamp.nanosec')
GAP = 0.5
"""After a gap of this many seconds in the stamps the controller starts anew, and after as long a
silence the motor is sent 0; where stamps fall back by `RESTART`, its profile starts anew, too."""
MANY = 20
"""So many late samples in a row, and it is the clock that was set back."""
FAREWELLS = 5
"""How often 0 is sent to stop the motor: a best-effort reader may miss some."""
FAREWELL_STEP = SECOND // 200
"""Time between them, ns."""
OFF = 'topic'
"""Value of the parameter `profile` with which the reference is read from the topic."""


@dataclass(frozen=True)
class PidSettings:
    """Parameters of the node."""

    kp: float = parameter(0.15, 'Proportional gain.', 'V s/rad', 0, 1e4, live=True)
    ki: float = parameter(2.5, 'Integral gain.', 'V/rad', 0, 1e5, live=True)
    kd: float = parameter(0.0, 'Derivative gain.', 'V s^2/rad', 0, 1e3, live=True)
    derivative_filter: float = parameter(
        0.005, 'Time constant of the low-pass on the derivative.', 's', 0, 10, live=True
    )
    command: str = parameter(
        'voltage', 'What it commands: a voltage, or the current that a three-phase drive follows; '
        'the gains are then in A where they are in V here.', choices=('voltage', 'current'),
    )  # fmt: skip
    voltage_limit: float = parameter(24.0, 'Largest voltage, either way.', 'V', 0, 1000, live=True)
    current_limit: float = parameter(
        5.0, 'Largest current, either way, where current is commanded.', 'A', 0, 1000, live=True
    )
    profile: str = parameter(
        OFF, 'Where the reference comes from: the topic, or this built-in profile.', '',
        choices=(OFF, *PROFILES), live=True,
    )  # fmt: skip
    reference_timeout: float = parameter(
        1.0, 'Time after which the reference is 0 once nobody publishes its topic any more; 0 for '
        'never.', 's', 0, 1e5, live=True,
    )  # fmt: skip
    top_speed: float = parameter(
        200.0, 'Largest speed of the profile.', 'rad/s', 0, 1e5, live=True
    )
    profile_duration: float = parameter(20.0, 'Duration of the profile.', 's', 0.1, 1e5, live=True)
    autostart: bool = parameter(
        True, 'Start a profile with the first sample, not with the service ~/start.'
    )

    def gains(self) -> PidGains:
        """Return the gains of the controller."""
        limit = self.voltage_limit if self.command == 'voltage' else self.current_limit
        limit = max(limit, 1e-9)
        return PidGains(self.kp, self.ki, self.kd, self.derivative_filter, -limit, limit)

    def route(self) -> tuple[str, float, float]:
        """Return what the reference comes from; when it changes, it starts anew."""
        if self.profile == OFF:
            return OFF, 0.0, 0.0
        return self.profile, self.top_speed, self.profile_duration

    def make_profile(self) -> Profile | None:
        """Return the profile, None where the reference comes from the topic."""
        if self.profile == OFF:
            return None
        return Profile(self.profile, self.top_speed, self.profile_duration)


class PidNode(LoopNode):
    """Answers every sample of motor/speed with a command that bears the same stamp.

    The sample time is taken from the stamps.  Where samples came in a bunch, each is worked on in
    turn, so that the controller's memory is right; the last command is the one that counts.
    """

    period = 0.001

    def __init__(
        self, context: Context | None = None, overrides: Sequence[Parameter] = ()
    ) -> None:
        super().__init__('pid', context, overrides)
        self.settings = Settings(self, PidSettings)
        self._pid = Pid(self.settings.value.gains())
        self._profile = self.settings.value.make_profile()
        self._route = self.settings.value.route()
        self._enabled = self._profile is None or self.settings.value.autostart
        self._start: int | None = None
        self._last: int | None = None
        self._late = 0
        self._answered: int | None = None
        self._simulated = bool(self.get_parameter('use_sim_time').value)
        self._speed = RawTopic(self, 'motor/speed', 'sensor_msgs/msg/JointState')
        self._read_speed = FieldReader('sensor_msgs/msg/JointState', (*STAMP, 'velocity[0]')).read
        command = self.settings.value.command
        self._command = vector_publisher(
            self, f'motor/{command}_command', 'dc' if command == 'voltage' else 'q'
        )
        self._connect_reference()
        self.create_service(Trigger, '~/start', self._on_start)
        self.create_service(Trigger, '~/stop', self._on_stop)
        self.settings.on_change(self._change)
        self._next_look = 0.0
        self.get_logger().info(f'reference from {self.settings.value.profile}')

    def _connect_reference(self) -> None:
        """Publish the profile, or listen to the topic; never both."""
        self._given = self._own = None
        if self._profile is None:
            self._given = GivenReference(self)
        else:
            self._own = vector_publisher(self, 'motor/reference', 'speed')

    def step(self) -> None:
        """Answer the samples that have come."""
        now = time.monotonic()
        if now >= self._next_look:
            self._next_look = now + 1.0
            self._speed.adapt()
            if self._given is not None:
                self._given.adapt()
        if self._given is not None:
            self._given.look(self.settings.value.reference_timeout)
        for message in self._speed.drain():
            seconds, nanoseconds, speed = self._read_speed(message.data)
            self._answer(int(seconds) * SECOND + int(nanoseconds), float(speed))
        self._watch()

    def close(self) -> None:
        """Leave the motor at 0 V or 0 A, and give the message time to arrive."""
        self._send_zero(FAREWELL_STEP)
        self._command.publisher.wait_for_all_acked(Duration(seconds=0.5))

    def _send_zero(self, step: int) -> None:
        """Send 0 V or 0 A now, with stamps that go on by `step` ns from the last sample's."""
        stamp = now_ns(self.get_clock()) if self._last is None else self._last
        for k in range(FAREWELLS):
            self._command.publish(stamp + (k + 1) * step, 0.0, 0.0, 0.0)
            time.sleep(FAREWELL_STEP / SECOND)

    def _watch(self) -> None:
        """Stop a motor that is not seen any more: it would go on with the last command."""
        if self._answered is None or not self._enabled:
            return
        self._answered = min(self._answered, self._now())
        if self._now() - self._answered > GAP * SECOND:
            self._answered = None
            self._send_zero(FAREWELL_STEP)
            self.get_logger().warning(
                f'no sample of {self._speed.resolved} for {GAP:g} s that could be answered: 0 was '
                'sent; look at the sensor and its stamps'
            )

    def _now(self) -> int:
        """Return the time in ns by which silence is judged: a simulation may pause."""
        return now_ns(self.get_clock()) if self._simulated else time.monotonic_ns()

    def _answer(self, stamp: int, speed: float) -> None:
        last = self._last
        if not math.isfinite(speed) or self._is_late(stamp):
            return
        self._last = stamp
        if last is None or stamp <= last:
            return
        if not self._enabled:
            self._hold(stamp)
            return
        dt = (stamp - last) / SECOND
        if dt > GAP:
            self._pid.reset()
            return
        reference = self._reference_at(stamp)
        self._send(stamp, self._pid.step(reference, speed, dt))

    def _is_late(self, stamp: int) -> bool:
        """Whether a sample came too late to be answered; the clock may have been set back, too."""
        if self._last is None or stamp > self._last:
            self._late = 0
            return False
        self._late += 1
        if stamp < self._last - RESTART:
            self._begin()
        elif self._late < MANY:
            return True
        else:
            self._pid.reset()
        self._late = 0
        return False

    def _hold(self, stamp: int) -> None:
        """Keep the motor at 0 V or 0 A, and say so, as long as the profile has not begun."""
        if self._own is not None:
            self._own.publish(stamp, 0.0, 0.0, 0.0)
        self._send(stamp, 0.0)

    def _send(self, stamp: int, output: float) -> None:
        self._command.publish(stamp, output, 0.0, 0.0)
        self._answered = self._now()

    def _reference_at(self, stamp: int) -> float:
        if self._profile is None or self._own is None:
            return self._given.value if self._given else 0.0
        if self._start is None:
            self._start = stamp
        reference = self._profile((stamp - self._start) / SECOND)
        self._own.publish(stamp, reference, 0.0, 0.0)
        return reference

    def _begin(self) -> None:
        """Start the profile with the next sample, the controller without a memory."""
        self._start = None
        self._pid.reset()

    def _on_start(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._enabled = True
        self._begin()
        response.success, response.message = True, 'started'
        return response

    def _on_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._enabled = False
        self._send_zero(0)
        response.success, response.message = True, 'stopped at 0'
        return response

    def _change(self, settings: PidSettings) -> None:
        self._pid = self._pid.with_gains(settings.gains())
        if settings.route() == self._route:
            return
        self._route = settings.route()
        self._disconnect_reference()
        if self._profile is None and not settings.autostart:
            self._enabled = False
        self._profile, self._start = settings.make_profile(), None
        self._connect_reference()

    def _disconnect_reference(self) -> None:
        if self._given is not None:
            self._given.destroy()
        if self._own is not None:
            self.destroy_publisher(self._own.publisher)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run(PidNode, args)


if __name__ == '__main__':
    raise SystemExit(main())
