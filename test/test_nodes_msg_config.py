"""A msg_config file live: frames of motor kinds, stamps that are numbers, namespaces."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from rclpy.node import Node
from ros_harness import wait_for
from std_msgs.msg import Float64MultiArray

from motor_sysid.errors import UserError
from motor_sysid.nodes.identifier import IdentifierNode
from motor_sysid.nodes.identifier_settings import IdentifierSettings
from motor_sysid.nodes.loop import LoopNode
from motor_sysid.nodes.motor import MotorNode
from motor_sysid.nodes.topics import sources_of

ARRAY = """
namespace: arm
stamp: 'data[0]'
signals:
  voltage: {topic: drive, field: 'data[1]', unit: V, stamp_unit: ms}
  current: {topic: drive, field: 'data[2]', unit: A, stamp_unit: ms}
  speed: {topic: drive, field: 'data[3]', unit: rad/s, stamp_unit: ms}
"""


@pytest.mark.parametrize('kind', ['brushed_dc', 'pmsm', 'bldc'])
def test_the_shipped_default_is_the_default_for_every_motor(
    make_node: Callable[..., LoopNode], kind: str
) -> None:
    motor = make_node(MotorNode, motor_kind=kind, rate=200.0)
    given = make_node(IdentifierNode, motor=kind, msg_config='default')
    plain = IdentifierSettings(motor=kind)

    def look() -> bool:
        motor.step()
        given.step()
        return given._pipeline is not None and given._pipeline.join.counts.joined > 10

    wait_for(look, 'samples')
    assert {topic.resolved for topic in given._topics} == {
        '/motor/voltage', '/motor/current', '/motor/speed'
    }  # fmt: skip
    signals = plain.configuration().plan(sources_of(plain.messages())).signals
    assert sorted(given._pipeline.signals) == sorted(signals)


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    (tmp_path / 'drive.yaml').write_text(ARRAY)
    return tmp_path / 'drive.yaml'


def test_a_stamp_may_be_a_number_in_a_unit_below_a_namespace(
    make_node: Callable[..., LoopNode], other: Node, drive: Path
) -> None:
    publisher = other.create_publisher(Float64MultiArray, '/arm/drive', 1000)
    node = make_node(IdentifierNode, msg_config=str(drive))
    wait_for(lambda: (node.step(), node._topics and node._topics[0].publishers)[1], 'a match')
    assert node._topics[0].resolved == '/arm/drive'
    for k in range(100):
        data = [1000.5 + 2 * k, 6.0, 0.3, 40.0 + k] if k != 50 else []
        publisher.publish(Float64MultiArray(data=data))
    pipeline = node._pipeline
    wait_for(lambda: (node.step(), pipeline.join.counts.joined == 99)[1], 'the samples')
    wait_for(lambda: (node.step(), not node.hurry)[1], 'the rest')
    stamps, values = pipeline.window.last()
    assert stamps.tolist() == [1_000_500_000 + 2_000_000 * k for k in range(100) if k != 50]
    assert values[-1].tolist() == [6.0, 0.3, 139.0]
    assert pipeline.not_finite == 1, 'a message without a stamp'


def test_a_stamp_that_can_be_none_is_left_out_and_told_once(
    make_node: Callable[..., LoopNode], other: Node, drive: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    drive.write_text(ARRAY.replace(', stamp_unit: ms', ''))
    publisher = other.create_publisher(Float64MultiArray, '/arm/drive', 1000)
    node = make_node(IdentifierNode, msg_config=str(drive), sample_time=0.001)
    told: list[str] = []
    logger = SimpleNamespace(warning=told.append, info=lambda text: None)
    monkeypatch.setattr(node, 'get_logger', lambda: logger)
    wait_for(lambda: (node.step(), node._topics and node._topics[0].publishers)[1], 'a match')
    odd = [1.7e18, 1.7e15, 1e300, 3e9, 2.0**31, -1.0, float('inf'), float('nan')]
    for stamp in [*odd, 5.0, 2.0**31 - 1]:
        publisher.publish(Float64MultiArray(data=[stamp, 6.0, 0.3, 40.0]))
    pipeline = node._pipeline
    wait_for(lambda: (node.step(), pipeline.join.counts.joined == 2)[1], 'the samples')
    assert pipeline.not_finite == len(odd)
    for _ in range(3):
        node._next_look = 0.0
        node.step()
    (line,) = told
    assert 'stamp 1.7e+18 s of topic `/arm/drive` lies outside 0 to 2147483648 s' in line
    assert '`stamp_unit`' in line


@pytest.mark.parametrize('stamp', ['header', 'layout', "'nothing[0]'"])
def test_a_stamp_that_the_type_lacks_is_refused(
    make_node: Callable[..., LoopNode], drive: Path, stamp: str
) -> None:
    text = ARRAY.replace("stamp: 'data[0]'", f'stamp: {stamp}', 1)
    drive.write_text(text.replace('stamp_unit: ms', 'type: std_msgs/msg/Float64MultiArray'))
    with pytest.raises(UserError, match=r'Float64MultiArray` of topic `/arm/drive` has no stamp'):
        make_node(IdentifierNode, msg_config=str(drive))


def test_reception_is_no_simulated_time(make_node: Callable[..., LoopNode], drive: Path) -> None:
    """At half the pace of the clock on the wall an inertia came out twice as large."""
    text = ARRAY.replace("stamp: 'data[0]'", 'stamp: receive').replace(', stamp_unit: ms', '')
    drive.write_text(text.replace('unit: V', 'unit: V, type: std_msgs/msg/Float64MultiArray'))
    assert make_node(IdentifierNode, msg_config=str(drive))._pipeline is not None
    with pytest.raises(UserError, match='receive` of /arm/drive is the time of reception, not'):
        make_node(IdentifierNode, msg_config=str(drive), use_sim_time=True)
