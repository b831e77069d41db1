"""Which topics an identifier listens to, by what is published."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from geometry_msgs.msg import Vector3Stamped
from rclpy.node import Node
from ros_harness import wait_for
from sensor_msgs.msg import BatteryState, JointState

from motor_sysid.nodes import search
from motor_sysid.nodes.identifier import IdentifierNode
from motor_sysid.nodes.loop import LoopNode
from motor_sysid.nodes.statuses import Status

DUTY = """
signals:
  voltage: {product: [duty, supply_voltage], unit: V}
  duty: {topic: motor/duty, field: vector.x}
  supply_voltage:
    - {topic: battery_state, field: voltage, unit: V, optional: true}
    - {constant: 24.0, unit: V}
  current: {topic: motor/current, field: vector.x, unit: A}
  speed: {topic: motor/speed, field: 'velocity[0]', unit: rad/s}
"""
TOPICS = {'motor/duty': Vector3Stamped, 'motor/current': Vector3Stamped, 'motor/speed': JointState}


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    (tmp_path / 'robot.yaml').write_text(DUTY)
    return tmp_path / 'robot.yaml'


def look(node: LoopNode) -> object:
    """Have the node look at what changes slowly; return whether it listens."""
    node._next_look = 0.0
    node.step()
    return node._pipeline


def lines_of(node: LoopNode, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return a list of what the node logs from now on."""
    told: list[str] = []
    logger = SimpleNamespace(warning=told.append, info=lambda text: None)
    monkeypatch.setattr(node, 'get_logger', lambda: logger)
    return told


def publish(other: Node, *names: str) -> None:
    """Offer topics."""
    for name in names:
        other.create_publisher(TOPICS.get(name, BatteryState), name, 10)


def test_a_source_that_is_there_is_taken(
    make_node: Callable[..., LoopNode], other: Node, robot: Path
) -> None:
    node = make_node(IdentifierNode, msg_config=str(robot))
    publish(other, 'battery_state', *TOPICS)
    wait_for(lambda: look(node), 'the topics')
    assert [t.resolved for t in node._topics if 'battery' in t.resolved] == ['/battery_state']


def test_an_optional_source_that_nobody_publishes_is_not_waited_for_long(
    make_node: Callable[..., LoopNode], other: Node, robot: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    clock = SimpleNamespace(monotonic=lambda: now)
    monkeypatch.setattr(search, 'time', clock)
    now = 100.0
    node = make_node(IdentifierNode, msg_config=str(robot))
    told = lines_of(node, monkeypatch)
    publish(other, 'motor/duty', 'motor/current')
    wait_for(lambda: (look(node), len(node._search.awaited))[1] == 2, 'two of the topics')
    assert node._search.awaited == ('/battery_state', '/motor/speed')
    now += 100.0
    assert not look(node), 'the robot has not started yet'
    publish(other, 'motor/speed')
    wait_for(lambda: (look(node), len(node._search.awaited))[1] == 1, 'the third topic')
    now += search.PATIENCE - 0.1
    assert not look(node)
    now += 0.2
    assert look(node)
    assert {topic.resolved for topic in node._topics} == {f'/{name}' for name in TOPICS}
    assert told[-1] == 'nobody publishes /battery_state: `supply_voltage` is taken from 24 [V]'


def test_what_is_waited_for_is_told(
    make_node: Callable[..., LoopNode], other: Node, robot: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """A misspelt topic, whose type is not known, left the node without a word."""
    robot.write_text(DUTY.replace('motor/current', 'motor/curent'))
    node = make_node(IdentifierNode, msg_config=str(robot))
    told, statuses = lines_of(node, monkeypatch), list[Status]()
    sink = SimpleNamespace(publish=lambda stamp, found: statuses.extend(found))
    monkeypatch.setattr(node, '_diagnostics', sink)
    monkeypatch.setattr(search, 'DISCOVERY', 0.2)
    publish(other, 'battery_state', *TOPICS)
    line = 'waiting for /motor/curent (nobody publishes it)'
    wait_for(lambda: (look(node), told.count(line))[1], 'the line')
    look(node)
    assert told.count(line) == 1
    *_, intake, diagnosis = statuses
    assert (intake.name, intake.message, intake.warn) == ('identifier: intake', line, True)
    assert diagnosis.name == 'identifier: diagnosis'
