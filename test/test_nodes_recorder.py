"""The node `recorder` over real DDS: simulated time, and types that ROS 2 Jazzy does not ship."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_harness import wait_for
from rosgraph_msgs.msg import Clock

from motor_sysid.nodes.identifier_settings import IdentifierSettings
from motor_sysid.nodes.intake import message_class
from motor_sysid.nodes.loop import Loop
from motor_sysid.nodes.monitor import Monitor
from motor_sysid.nodes.publishing import DiagnosticsPublisher, LATCHED, SECOND, vector_publisher
from motor_sysid.nodes.recorder import RecorderNode, TIMELESS
from motor_sysid.nodes.replay import recorded_configurations
from motor_sysid.nodes.statuses import Status
from motor_sysid.recording.cdr import column
from motor_sysid.recording.definitions import definitions
from motor_sysid.recording.rosbag import Bag

GOALS = 'nav_msgs/msg/Goals'
"""A type that is younger than the definitions of Jazzy that bags are written with."""


class Recording:
    """A recorder whose loop is turned until something is so."""

    def __init__(self, context: Context, path: Path, **given: object) -> None:
        overrides = {'path': str(path), **given}
        self.path = path
        self.node = RecorderNode(context, [Parameter(n, value=v) for n, v in overrides.items()])
        self._loop = Loop(self.node)

    def turn(self, done: Callable[[], object], what: str) -> None:
        wait_for(lambda: (self._loop.once(), done())[1], what)

    def finished(self) -> Bag:
        """End it and open its bag."""
        self.node.close()
        return Bag(self.path)


@pytest.fixture
def record(context: Context, tmp_path: Path) -> Iterator[Callable[..., Recording]]:
    made: list[Recording] = []

    def begin(**given: object) -> Recording:
        made.append(Recording(context, tmp_path / 'bag', **given))
        return made[-1]

    yield begin
    for one in made:
        one.node.destroy_node()


def test_what_comes_before_simulated_time_begins_is_received_when_it_does(
    record: Callable[..., Recording], other: Node
) -> None:
    model = DiagnosticsPublisher(other, 'identifier/model', LATCHED)
    configuration = IdentifierSettings().configuration()
    model.publish(0, [Status('configuration', configuration.to_texts())])
    volts = vector_publisher(other, 'motor/voltage', 'dc')
    clock = other.create_publisher(Clock, '/clock', 10)
    recording = record(use_sim_time=True)
    topics = recording.node._topics
    recording.turn(lambda: {'/identifier/model', '/motor/voltage'} <= set(topics), 'the topics')
    wait_for(lambda: topics['/motor/voltage'].publishers, 'a match')
    volts.publish(0, 1.0, 0.0, 0.0)
    recording.turn(lambda: clock.get_subscription_count(), 'the clock')
    assert all(topic.received == 0 for topic in topics.values()), 'they wait'
    message = Clock()
    message.clock.sec = 30

    def began() -> bool:
        clock.publish(message)  # best effort: the node may not have met this publisher yet
        return topics['/motor/voltage'].received == 1

    recording.turn(began, 'the time')
    volts.publish(0, 2.0, 0.0, 0.0)
    recording.turn(lambda: topics['/motor/voltage'].received == 2, 'the rest')
    recording.turn(lambda: topics['/identifier/model'].received == 1, 'the configuration')
    bag = recording.finished()
    assert {received for _, received, _ in bag.iterate()} == {30 * SECOND}
    (found,) = recorded_configurations(bag)
    assert found.since == 0


def test_a_recorder_without_a_clock_says_so(
    record: Callable[..., Recording], other: Node, capfd: pytest.CaptureFixture[str]
) -> None:
    vector_publisher(other, 'motor/voltage', 'dc').publish(0, 1.0, 0.0, 0.0)
    recording = record(use_sim_time=True)
    recording.turn(lambda: '/motor/voltage' in recording.node._topics, 'the topic')
    bag = recording.finished()
    assert list(bag.iterate()) == []
    wait_for(lambda: f'{TIMELESS}, so nothing was recorded' in capfd.readouterr().err, 'a line')


@pytest.mark.parametrize('storage', ['sqlite3', 'mcap'])
def test_a_type_of_an_installed_package_is_recorded_with_its_definition(
    record: Callable[..., Recording], other: Node, storage: str
) -> None:
    kind = message_class(GOALS)
    publisher = other.create_publisher(kind, 'goals', 10)
    recording = record(topics=['goals'], storage=storage)
    topics = recording.node._topics
    recording.turn(lambda: '/goals' in topics and topics['/goals'].publishers, 'the topic')
    message = kind()
    message.header.stamp.sec = 7
    message.goals.append(message_class('geometry_msgs/msg/PoseStamped')())
    message.goals[0].pose.position.y = 2.5
    publisher.publish(message)
    recording.turn(lambda: topics['/goals'].received, 'the message')
    bag = recording.finished()
    topic = bag.topics['/goals']
    assert any(b'RIHS01_' in file.read_bytes() for file in bag.path.iterdir())
    messages, types = bag.read(['/goals'])['/goals'], definitions([topic])
    read = column(messages, types, GOALS, 'goals[0].pose.position.y')
    assert read.values.tolist() == [2.5]


def test_a_topic_that_is_refused_is_not_listened_to(
    record: Callable[..., Recording], other: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('motor_sysid.nodes.recorder.own_definition', lambda name: None)
    publisher = other.create_publisher(message_class(GOALS), 'goals', 10)
    recording = record(topics=['goals'])
    recording.turn(lambda: '/goals' in recording.node._refused, 'the refusal')
    assert '/goals' not in recording.node._topics
    wait_for(lambda: publisher.get_subscription_count() == 0, 'its end')


def test_a_recorder_counts_what_it_heard_of_each_topic_and_a_monitor_waits_for_it(
    record: Callable[..., Recording], other: Node
) -> None:
    volts = vector_publisher(other, 'motor/voltage', 'dc')
    amperes = vector_publisher(other, 'motor/current', 'dc')
    recording = record()
    topics = recording.node._topics
    names = {'/motor/voltage', '/motor/current'}
    recording.turn(lambda: names <= set(topics), 'the topics')
    recording.turn(lambda: all(topics[n].publishers for n in names), 'a match')
    with Monitor() as monitor:

        def nothing_on() -> set[str]:
            begin = 'recorder has heard nothing on '
            return {t.removeprefix(begin) for t in monitor.unheard() if t.startswith(begin)}

        recording.turn(lambda: monitor.unheard() and monitor._recorded, 'the status')
        assert nothing_on() == {*names, '/motor/speed'}
        volts.publish(0, 1.0, 0.0, 0.0)
        recording.turn(lambda: nothing_on() == {'/motor/current', '/motor/speed'}, 'a count')
        for k in range(3):
            amperes.publish(k, 1.0, 0.0, 0.0)
        recording.turn(lambda: nothing_on() == {'/motor/speed'}, 'the other')
        recording.turn(
            lambda: monitor.unheard() and monitor._recorded['/motor/current'] == '3', 'all of it'
        )
