"""Time that falls back: what drives begins anew or ends safely, what listens goes on."""

from collections.abc import Callable
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from rclpy.node import Node
from ros_harness import wait_for
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from motor_sysid.control.profile import Profile
from motor_sysid.nodes.excitation import ExcitationNode, State
from motor_sysid.nodes.identifier import IdentifierNode
from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.loop import Loop, LoopNode
from motor_sysid.nodes.motor import MotorNode
from motor_sysid.nodes.pid import PidNode
from motor_sysid.nodes.pipeline import Pipeline
from motor_sysid.nodes.publishing import joint_publisher, SECOND, vector_publisher
from motor_sysid.recording.field_reader import FieldReader

VECTOR = 'geometry_msgs/msg/Vector3Stamped'
STEP = SECOND // 100


def send(other: Node, pipeline: Pipeline, node: LoopNode, *starts: int) -> None:
    """Give an identifier 2 s of a motor that turns to and fro from each stamp (ns) on."""
    volts = vector_publisher(other, 'motor/voltage', 'dc')
    amperes = vector_publisher(other, 'motor/current', 'dc')
    speed = joint_publisher(other, 'motor/speed', 'motor', ('position', 'velocity'))
    wait_for(lambda: (node.step(), all(t.publishers for t in node._topics))[1], 'a match')
    for start in starts:
        for k in range(200):
            stamp, wave = start + k * STEP, 1.0 if k // 20 % 2 else -1.0
            volts.publish(stamp, 6.0 * wave, 0.0, 0.0)
            amperes.publish(stamp, 0.3 * wave + 0.001 * (k % 7), 0.0, 0.0)
            speed.publish(stamp, 0.01 * k, 40.0 * wave + 0.1 * (k % 5))
    count = 200 * len(starts)
    wait_for(
        lambda: (node.step(), pipeline.join.counts.joined == count and not node.hurry)[1], 'all'
    )
    node._send(0)


class Heard:
    """The (stamp in ns, x) of the messages of a topic."""

    def __init__(self, node: Node, topic: str) -> None:
        self._topic, self.values = RawTopic(node, topic, VECTOR), []
        self._read = FieldReader(
            VECTOR, ('header.stamp.sec', 'header.stamp.nanosec', 'vector.x')
        ).read

    @property
    def matched(self) -> bool:
        return self._topic.publishers > 0

    def look(self) -> list[tuple[int, float]]:
        for message in self._topic.drain():
            seconds, nanoseconds, x = self._read(message.data)
            self.values.append((int(seconds) * SECOND + int(nanoseconds), float(x)))
        return self.values


class SimulatedClock:
    """Publishes /clock to one node, and turns its loop until something is so."""

    def __init__(self, other: Node, node: LoopNode) -> None:
        self._publisher, self._node = other.create_publisher(Clock, '/clock', 10), node
        self._loop = Loop(node)
        wait_for(self._publisher.get_subscription_count, 'a match')

    def turn(self, done: Callable[[], object], what: str) -> None:
        wait_for(lambda: (self._loop.once(), done())[1], what)

    def go(self, *times: int) -> None:
        """Have it be these times in ns, one after the other."""
        for time in times:
            message = Clock()
            message.clock.sec, message.clock.nanosec = divmod(time, SECOND)
            self._publisher.publish(message)
            now = self._node.get_clock().now
            self.turn(lambda time=time, now=now: now().nanoseconds == time, 'the time')


def test_the_controller_begins_its_profile_anew(
    make_node: Callable[..., LoopNode], other: Node
) -> None:
    profile = Profile('steps', 100.0, 1.0)
    pid = make_node(PidNode, profile='steps', profile_duration=1.0, top_speed=100.0, ki=50.0)
    reference, command = Heard(other, 'motor/reference'), Heard(other, 'motor/voltage_command')
    speed = joint_publisher(other, 'motor/speed', 'motor', ('position', 'velocity'))
    wait_for(
        lambda: speed.publisher.get_subscription_count() and reference.matched and command.matched,
        'a match',
    )
    for start in (500 * SECOND, 20 * SECOND):
        for k in range(60):
            speed.publish(start + k * STEP, 0.0, 0.0)
    wait_for(lambda: (pid.step(), len(command.look()) == 2 * 59)[1], 'the answers')
    wait_for(lambda: len(reference.look()) == 2 * 59, 'the references')
    first, again = reference.values[:59], reference.values[59:]
    assert [x for _, x in first] == pytest.approx([profile(k * STEP / SECOND) for k in range(59)])
    assert [(stamp - again[0][0], x) for stamp, x in again] == [
        (stamp - first[0][0], x) for stamp, x in first
    ]
    volts = [x for _, x in command.values]
    assert volts[:59] == volts[59:], 'no memory of the time before'


def test_an_experiment_ends_at_zero(make_node: Callable[..., LoopNode], other: Node) -> None:
    node = make_node(ExcitationNode, duration=60.0, rate=100.0, use_sim_time=True)
    heard, clock = Heard(other, 'motor/reference'), SimulatedClock(other, node)
    clock.turn(lambda: heard.matched, 'a match')
    clock.go(500 * SECOND)
    assert node._begin() == ''
    clock.go(500 * SECOND + STEP, 510 * SECOND)
    clock.turn(lambda: heard.look() and heard.values[-1][1] != 0.0, 'a speed')
    clock.go(507 * SECOND)
    clock.turn(lambda: node.state is State.STOPPED, 'its end')
    assert node.reason == 'time fell back by more than a second'
    wait_for(lambda: [x for _, x in heard.look()][-5:] == [0.0] * 5, 'zero')
    assert heard.values[-5][0] == 507 * SECOND
    assert node._begin() == '', 'it may begin again'
    clock.go(507 * SECOND + STEP)
    assert node.state is State.RUNNING


def test_the_motor_forgets_a_command_of_the_future(
    make_node: Callable[..., LoopNode], other: Node
) -> None:
    node = make_node(MotorNode, rate=100.0, use_sim_time=True)
    voltage, clock = Heard(other, 'motor/voltage'), SimulatedClock(other, node)
    command = vector_publisher(other, 'motor/voltage_command', 'dc')
    clock.turn(lambda: command.publisher.get_subscription_count() and voltage.matched, 'a match')
    clock.go(500 * SECOND)
    command.publish(0, 5.0, 0.0, 0.0)
    clock.turn(lambda: node._command == 5.0, 'the command')
    clock.go(500 * SECOND + STEP)
    clock.turn(lambda: voltage.look() and voltage.values[-1][1] == 5.0, 'the voltage')
    clock.go(20 * SECOND)
    clock.turn(lambda: voltage.look()[-1][0] == 20 * SECOND, 'a sample')
    assert voltage.values[-1][1] == 0.0


def test_refits_go_on_with_the_new_samples(
    make_node: Callable[..., LoopNode], other: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make_node(IdentifierNode, refit_period=0.5, refit_window=1.0)
    asked = []
    monkeypatch.setattr(
        node._work._jobs, 'ask', lambda kind, make_node: asked.append((kind, make_node())) or True
    )
    send(other, node._pipeline, node, 500 * SECOND, 20 * SECOND)
    assert node._pipeline.join.counts.restarts == 1
    assert [kind for kind, _ in asked] == ['refit'] * 4, 'at 1.0 and 1.5 s of either'
    for _, job in asked:
        assert job.record.duration == pytest.approx(1.0, abs=0.02)
    assert node._on_refit(Trigger.Request(), Trigger.Response()).success
    assert asked[-1][1].record['position'][-1] == pytest.approx(1.99)


def test_a_refit_without_samples_is_refused_and_one_that_lost_them_says_so(
    make_node: Callable[..., LoopNode], other: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make_node(IdentifierNode)
    told: list[str] = []
    monkeypatch.setattr(node._work, '_logger', SimpleNamespace(warning=told.append))
    send(other, node._pipeline, node, SECOND)
    assert node._on_refit(Trigger.Request(), Trigger.Response()).success
    assert node._on_reset(Trigger.Request(), Trigger.Response()).success
    node._work.poll()
    assert told == ['no refit: there are fewer than two samples in the last 10 s']
    answer = node._on_refit(Trigger.Request(), Trigger.Response())
    assert (answer.success, answer.message) == (False, told[0].removeprefix('no refit: '))
