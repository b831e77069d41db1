"""The controller lets go: asked to stop, without feedback, and without anyone to follow."""

from collections.abc import Callable
import math

import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_harness import wait_for
from std_srvs.srv import Trigger
from test_nodes_time import Heard, SimulatedClock

from motor_sysid.nodes.loop import LoopNode
from motor_sysid.nodes.pid import FAREWELLS, MANY, PidNode
from motor_sysid.nodes.publishing import joint_publisher, SECOND, vector_publisher

STEP = SECOND // 100
SPEED = 50.0


class Loop:
    """A controller, its feedback and who gives it a reference."""

    def __init__(self, make_node: Callable[..., LoopNode], other: Node, **given: object) -> None:
        self.pid, self.other = make_node(PidNode, ki=0.0, **given), other
        self._command = Heard(other, 'motor/voltage_command')
        self._speed = joint_publisher(other, 'motor/speed', 'motor', ('position', 'velocity'))
        self.reference = vector_publisher(other, 'motor/reference', 'speed')
        self._stamp = 100 * SECOND
        wait_for(self._matched, 'a match')

    def _matched(self) -> bool:
        self.pid.step()
        subscribed = self._speed.publisher.get_subscription_count()
        return bool(subscribed and self._command.matched)

    def sample(self) -> None:
        """Give the controller one sample of a motor at rest."""
        self._stamp += STEP
        self._speed.publish(self._stamp, 0.0, 0.0)

    def answer(self) -> float:
        """Return the command that answers a new sample."""
        self.sample()
        wait_for(lambda: (self.pid.step(), self._newest()[0] == self._stamp)[1], 'an answer')
        return self._newest()[1]

    def _newest(self) -> tuple[int, float]:
        return self.commands()[-1] if self.commands() else (0, 0.0)

    def commands(self) -> list[tuple[int, float]]:
        return self._command.look()

    def drive(self) -> None:
        """Have it follow a reference that was given once."""
        wait_for(self.reference.publisher.get_subscription_count, 'a match')
        self.reference.publish(0, SPEED, 0.0, 0.0)
        self.sample()
        wait_for(lambda: self.answer() > 0.0, 'a voltage')

    def zero(self) -> None:
        """See that it sent 0 by itself, to those that miss some, too."""
        wait_for(lambda: [x for _, x in self.commands()][-FAREWELLS:] == [0.0] * FAREWELLS, '0 V')

    def pass_time(self, seconds: float) -> None:
        """Have the last sign of a publisher be older."""
        self.pid._given._given -= seconds
        self.pid._given._next_look = 0.0

    def set(self, **given: object) -> None:
        results = self.pid.set_parameters([Parameter(n, value=v) for n, v in given.items()])
        assert all(result.successful for result in results)


@pytest.fixture
def loop(make_node: Callable[..., LoopNode], other: Node) -> Callable[..., Loop]:
    return lambda **given: Loop(make_node, other, **given)


def test_stop_sends_zero_though_no_sample_comes(loop: Callable[..., Loop]) -> None:
    running = loop()
    running.drive()
    assert running.pid._on_stop(Trigger.Request(), Trigger.Response()).success
    running.zero()
    assert running.answer() == 0.0, 'and the next sample is answered as ever'


def test_a_motor_that_is_not_seen_any_more_is_stopped(
    loop: Callable[..., Loop], capfd: pytest.CaptureFixture[str]
) -> None:
    running = loop()
    running.drive()
    count = len(running.commands())
    wait_for(lambda: (running.pid.step(), len(running.commands()) > count)[1], 'a command')
    running.zero()
    wait_for(lambda: 'no sample of /motor/speed for 0.5 s' in capfd.readouterr().err, 'a line')
    running.pid._watch()
    assert running.answer() > 0.0, 'it goes on where samples do'
    assert len(running.commands()) == count + FAREWELLS + 1, 'it was sent once'


def test_a_simulation_may_pause(
    make_node: Callable[..., LoopNode], other: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('motor_sysid.nodes.pid.time.monotonic_ns', lambda: 10**18)
    pid = make_node(PidNode, use_sim_time=True)
    clock = SimulatedClock(other, pid)
    clock.go(500 * SECOND)
    pid._answered = pid._now()
    sent = []
    monkeypatch.setattr(pid, '_send_zero', sent.append)
    pid._watch()
    clock.go(500 * SECOND + SECOND // 4)
    assert not sent
    clock.go(501 * SECOND)
    assert len(sent) == 1


def test_a_reference_that_was_given_once_holds_as_long_as_its_publisher_is_there(
    loop: Callable[..., Loop], capfd: pytest.CaptureFixture[str]
) -> None:
    running = loop(reference_timeout=0.3)
    running.drive()
    running.pass_time(100.0)
    assert running.answer() > 0.0, 'silent, but there'
    running.other.destroy_publisher(running.reference.publisher)
    wait_for(lambda: running.answer() == 0.0, 'its end')
    wait_for(lambda: 'nobody publishes /motor/reference any' in capfd.readouterr().err, 'a line')


def test_a_reference_may_be_kept_for_ever(loop: Callable[..., Loop]) -> None:
    running = loop(reference_timeout=0.0)
    running.drive()
    running.other.destroy_publisher(running.reference.publisher)
    wait_for(lambda: not running.other.count_publishers('/motor/reference'), 'its end')
    running.pass_time(100.0)
    assert running.answer() > 0.0


def test_a_profile_in_between_forgets_the_reference(loop: Callable[..., Loop]) -> None:
    running = loop()
    running.drive()
    running.set(top_speed=120.0)
    assert running.answer() > 0.0, 'what the topic does not need changes nothing'
    running.set(profile='steps')
    running.answer()
    running.set(profile='topic')
    assert running.answer() == 0.0


@pytest.mark.parametrize('autostart', [True, False])
def test_a_profile_that_is_chosen_later_waits_for_its_start_as_well(
    loop: Callable[..., Loop], autostart: bool
) -> None:
    running = loop(autostart=autostart)
    running.drive()
    running.set(profile='steps', profile_duration=1.0)
    moved = [running.answer() for _ in range(40)]
    assert any(moved) is autostart
    running.pid._on_start(Trigger.Request(), Trigger.Response())
    assert any(running.answer() for _ in range(40))


def test_late_and_missing_samples_leave_the_time_between_samples_alone(
    make_node: Callable[..., LoopNode], monkeypatch: pytest.MonkeyPatch
) -> None:
    pid = make_node(PidNode)
    steps: list[float] = []
    monkeypatch.setattr(pid._pid, 'step', lambda reference, speed, dt: steps.append(dt) or 0.0)
    start = 100 * SECOND
    for k in range(10):
        pid._answer(start + k * STEP, 1.0)
    pid._answer(start, 1.0)  # 0.1 s late
    pid._answer(start + 10 * STEP, math.nan)
    pid._answer(start + 11 * STEP, 1.0)
    assert steps == pytest.approx([0.01] * 9 + [0.02])
    back = start - SECOND // 2  # the clock is set back
    for k in range(MANY + 5):
        pid._answer(back + k * STEP, 1.0)
    assert steps[10:] == pytest.approx([0.01] * 5)
