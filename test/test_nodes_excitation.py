"""The node `excitation` over real DDS: exact samples, and a safe end however it comes about."""

from collections.abc import Callable, Iterator, Mapping
import math
from pathlib import Path

import pytest

from motor_sysid.control.profile import Hold, Part, Profile, Sweep
from motor_sysid.control.profile_file import save_profile
from motor_sysid.errors import UserError

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from ros_harness import nodes, PATIENCE, wait_for
from ros_harness import parameters as arguments
from std_srvs.srv import Trigger

from motor_sysid.nodes.excitation import ExcitationNode, State
from motor_sysid.nodes.excitation_watch import Bounds, Watch
from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.loop import Loop, LoopNode
from motor_sysid.nodes.motor import MotorNode
from motor_sysid.nodes.pid import PidNode
from motor_sysid.nodes.publishing import SECOND, vector_publisher

VECTOR = 'geometry_msgs/msg/Vector3Stamped'
VOLTS = Profile(
    'volts', 5.0, 0.5, (Part(1.0, Hold(0.8)), Part(2.0, Sweep(1.0, 1.0, 3.0))), 'voltage', 'V'
)
SPEED = Profile('speeds', 60.0, 0.8, (Part(1.0, Hold(1.0)), Part(1.0, Hold(-0.5))))
AMPERES = Profile('amperes', 2.0, 0.3, (Part(1.0, Hold(1.0)),), 'current', 'A')
TORQUE = Profile('torques', 2.0, 0.3, (Part(1.0, Hold(1.0)),), 'torque', 'N m')
LONG = Profile('long', 6.0, 60.0, (Part(1.0, Hold(1.0)),), 'voltage', 'V')


@pytest.fixture
def kept(context: Context) -> Iterator[list[LoopNode]]:
    """Nodes that are let go of even if the test fails, so that no later test meets them."""
    nodes: list[LoopNode] = []
    yield nodes
    for node in nodes:
        node.destroy_node()


@pytest.fixture
def make(
    context: Context, tmp_path: Path, kept: list[LoopNode]
) -> Callable[..., ExcitationNode]:
    def build(
        profile: Profile, limits: Mapping[str, float] | None = None, **given: object
    ) -> ExcitationNode:
        path = tmp_path / f'{profile.name}.yaml'
        save_profile(profile, path, limits=limits)
        overrides = {'profile': str(path), 'rate': 200, **given}
        node = ExcitationNode(context, [Parameter(n, value=v) for n, v in overrides.items()])
        kept.append(node)
        return node

    return build


class Heard:
    """The (stamp, x) of a topic's messages."""

    def __init__(self, node: Node, topic: str) -> None:
        self._topic, self.values = RawTopic(node, topic, VECTOR), []

    def look(self) -> list[tuple[int, float]]:
        for raw in self._topic.drain():
            message = deserialize_message(raw.data, Vector3Stamped)
            stamp = message.header.stamp
            self.values.append((stamp.sec * SECOND + stamp.nanosec, message.vector.x))
        return self.values

    @property
    def matched(self) -> bool:
        return self._topic.publishers > 0


def turn(done: Callable[[], object], *running: LoopNode) -> None:
    """Turn the loops of the nodes until something is so."""
    loops = [Loop(node) for node in running]

    def once() -> bool:
        for loop in loops:
            loop.once()
        return bool(done())

    wait_for(once, 'what the test waits for', PATIENCE)
    for loop in loops:
        loop.shutdown()


def call(other: Node, service: str, *running: LoopNode) -> Trigger.Response:
    client = other.create_client(Trigger, service)
    turn(client.service_is_ready, *running)
    future = client.call_async(Trigger.Request())
    executor = rclpy.executors.SingleThreadedExecutor(context=other.context)
    executor.add_node(other)

    def answered() -> bool:
        executor.spin_once(timeout_sec=0)
        return future.done()

    turn(answered, *running)
    executor.shutdown()
    return future.result()


def test_every_sample_is_the_profile_at_its_stamp_and_zero_follows(
    make: Callable[..., ExcitationNode], other: Node
) -> None:
    node, heard = make(VOLTS), Heard(other, 'motor/voltage_command')
    turn(lambda: heard.matched, node)
    for _ in range(5):
        node.step()
    assert heard.look() == [], 'nothing before the start'
    assert call(other, '/excitation/start', node).success
    turn(lambda: node.state is State.DONE, node)
    wait_for(lambda: len(heard.look()) >= 105, 'the farewells')
    run, farewell = heard.values[:-5], heard.values[-5:]
    start = run[0][0]
    assert [stamp - start for stamp, _ in run] == [k * 5_000_000 for k in range(100)]
    for stamp, value in run:
        assert value == pytest.approx(VOLTS((stamp - start) / SECOND), abs=1e-12)
    assert {value for _, value in farewell} == {0.0}
    assert [s for s, _ in heard.values] == sorted({s for s, _ in heard.values})


def test_a_controller_follows_a_speed_profile(
    make: Callable[..., ExcitationNode], context: Context, other: Node, kept: list[LoopNode]
) -> None:
    motor, pid = MotorNode(context), PidNode(context)
    kept += [motor, pid]
    node = make(SPEED, {'speed': 3000.0, 'current': 300.0}, autostart=True)
    reference, current = Heard(other, 'motor/reference'), Heard(other, 'motor/current')
    seen: list[float] = []

    def done() -> bool:
        seen.append(motor._plant.stepper.state['omega'])
        return node.state is not State.WAITING and node.state is not State.RUNNING

    turn(done, motor, pid, node)
    assert node.state is State.DONE, node.reason
    assert max(seen) > 40
    assert min(seen) < -15
    assert {round(x, 9) for _, x in reference.look()} == {60.0, -30.0, 0.0}
    assert reference.values[-1][1] == 0.0
    assert current.look()


@pytest.mark.parametrize(
    ('limits', 'word'),
    [({'current': 0.5}, 'current'), ({'speed': 20.0}, 'speed'), ({'travel': 0.3}, 'travel')],
)
def test_a_limit_that_is_passed_ends_it_with_zero_volts(
    make: Callable[..., ExcitationNode], context: Context, other: Node, kept: list[LoopNode],
    limits: dict[str, float], word: str,
) -> None:  # fmt: skip
    motor, node = MotorNode(context), make(LONG, limits, autostart=True)
    kept.append(motor)
    heard = Heard(other, 'motor/voltage')
    turn(lambda: node.state is State.STOPPED, motor, node)
    assert node.reason.startswith(f'{word} ')
    assert 'beyond its limit' in node.reason
    turn(lambda: heard.look() and heard.values[-1][1] == 0.0, motor, node)
    assert max(v for _, v in heard.values) == 6.0


def test_a_current_goes_to_the_drives_that_follow_one(
    make: Callable[..., ExcitationNode], context: Context, other: Node, kept: list[LoopNode]
) -> None:
    motor = MotorNode(context, [Parameter('motor_kind', value='pmsm')])
    kept.append(motor)
    heard = Heard(other, 'motor/current_command')
    node, seen = make(AMPERES, {'input': 1.5}), set()
    assert node._topic == '/motor/current_command'
    turn(lambda: heard.matched and node.count_subscribers(node._topic) == 2, motor, node)
    turn(lambda: node._begin() == '', node)
    turn(lambda: (seen.add(motor._command), node.state is State.DONE)[1], motor, node)
    assert seen == {0.0, 1.5}
    wait_for(lambda: [x for _, x in heard.look()][-5:] == [0.0] * 5, 'the end')


def test_a_signal_that_no_topic_carries_is_refused(make: Callable[..., ExcitationNode]) -> None:
    with pytest.raises(UserError, match=r'a torque in N m, which no topic .* voltage, current'):
        make(TORQUE)


def test_a_profile_that_nobody_hears_is_said(
    make: Callable[..., ExcitationNode], other: Node
) -> None:
    told = RawTopic(other, '/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray')
    node, lines = make(LONG), list[str]()

    def said(words: str) -> bool:
        arrays = (deserialize_message(m.data, DiagnosticArray) for m in told.drain())
        lines.extend(status.message for array in arrays for status in array.status)
        return any(words in line for line in lines)

    turn(lambda: node._begin() == '', node)
    turn(lambda: said('nobody listens to /motor/voltage_command'), node)
    lines.clear()
    heard = Heard(other, 'motor/voltage_command')
    turn(lambda: heard.matched and said(State.RUNNING.value), node)


def test_silence_of_a_watched_topic_ends_it(make: Callable[..., ExcitationNode]) -> None:
    node = make(LONG, {'speed': 20.0}, feedback_timeout=0.1)
    turn(lambda: node._begin() == '', node)
    turn(lambda: node.state is State.STOPPED, node)
    assert 'nothing was heard of the measured speed' in node.reason


def test_voltage_is_limited_by_the_file_and_the_parameter_goes_first(
    make: Callable[..., ExcitationNode], other: Node
) -> None:
    heard = Heard(other, 'motor/voltage_command')
    node = make(VOLTS, {'input': 4.5}, input_limit=2.0)
    turn(lambda: heard.matched, node)
    turn(lambda: node._begin() == '', node)
    turn(lambda: node.state is State.DONE, node)
    wait_for(lambda: len(heard.look()) >= 105, 'all')
    assert max(abs(v) for _, v in heard.values) == 2.0


def test_two_masters_are_refused_and_stop_stops(
    make: Callable[..., ExcitationNode], context: Context, other: Node
) -> None:
    node, heard = make(LONG), Heard(other, 'motor/voltage_command')
    rival = vector_publisher(other, 'motor/voltage_command', 'dc')
    turn(lambda: node.count_publishers('motor/voltage_command') == 2, node)
    answer = call(other, '/excitation/start', node)
    assert not answer.success
    assert 'two masters' in answer.message
    assert node.state is State.WAITING
    other.destroy_publisher(rival.publisher)
    turn(lambda: node.count_publishers('motor/voltage_command') == 1, node)
    assert call(other, '/excitation/start', node).success
    assert not call(other, '/excitation/start', node).success, 'running already'
    turn(lambda: heard.look() and heard.values[-1][1] == 6.0, node)
    assert call(other, '/excitation/stop', node).success
    turn(lambda: heard.look() and heard.values[-1][1] == 0.0, node)
    assert (node.state, node.reason) == (State.STOPPED, 'asked to stop')
    assert call(other, '/excitation/start', node).success, 'it may begin again'
    node.close()
    turn(lambda: heard.look() and heard.values[-1][1] == 0.0, node)


def test_a_signal_leaves_zero_volts(other: Node, tmp_path: Path) -> None:
    save_profile(LONG, tmp_path / 'long.yaml')
    given = arguments(profile=tmp_path / 'long.yaml', rate=200.0)
    heard = Heard(other, '/motor/voltage_command')
    start = other.create_client(Trigger, '/excitation/start')
    with nodes(excitation=given) as running:
        wait_for(lambda: start.service_is_ready() and heard.matched, 'the node')
        wait_for(
            lambda: other.count_publishers('/motor/voltage_command') == 1, 'the last test to end'
        )
        start.call_async(Trigger.Request())
        wait_for(lambda: heard.look() and heard.values[-1][1] == 6.0, 'a voltage')
        assert running['excitation'].end() == 0, running['excitation'].output()
        wait_for(lambda: [v for _, v in heard.look()][-3:] == [0.0] * 3, '0 V')


def test_a_profile_that_does_not_exist_is_refused(context: Context) -> None:
    with pytest.raises(UserError, match='neither a file nor one of mixed'):
        ExcitationNode(context, [Parameter('profile', value='/nowhere.yaml')])


def test_the_watch_counts_travel_from_the_first_sample_and_forgives_what_is_missing() -> None:
    watch = Watch(Bounds(speed=10.0, travel=2.0, timeout=1.0), now=5.0)
    assert watch.moved(5.1, -9.0, 100.0) == ''
    assert watch.moved(5.2, math.nan, 101.9) == ''
    assert 'travel 2.1 is beyond its limit 2 from the start' in watch.moved(5.3, 0.0, 97.9)
    assert 'speed -11 is beyond its limit 10' in watch.moved(5.4, -11.0, 100.0)
    assert watch.flowed(5.4, 1e9) == '', 'no limit of current'
    assert watch.silent(6.3) == ''
    assert 'measured speed' in watch.silent(6.5)
    turning = Watch(Bounds(travel=20.0), now=0.0)
    told = [turning.moved(0.1, 1.0, 0.5 * k % (2 * math.pi)) for k in range(60)]
    assert [bool(text) for text in told] == [k > 40 for k in range(60)], 'within one turn or not'
    assert watch.moved(6.6, 1.0, math.nan) == ''
    assert 'measured travel' in watch.silent(6.6), 'a speed without position does not do'
