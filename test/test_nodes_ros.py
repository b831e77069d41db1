"""The nodes in this process, over real DDS."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, fields
from itertools import pairwise
import math
from pathlib import Path
import time
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from ros_harness import PATIENCE, wait_for
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
import yaml

from motor_sysid.errors import UserError
from motor_sysid.nodes.excitation import ExcitationSettings
from motor_sysid.nodes.identifier import IdentifierNode
from motor_sysid.nodes.identifier_settings import IdentifierSettings
from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.loop import Loop, LoopNode
from motor_sysid.nodes.message_types import installed_types
from motor_sysid.nodes.motor import MotorNode, MotorSettings
from motor_sysid.nodes.parameters import checked, config_yaml, parameter, Settings, spec_of
from motor_sysid.nodes.pid import PidNode, PidSettings
from motor_sysid.nodes.publishing import (
    joint_publisher,
    pack_diagnostics,
    SECOND,
    STREAM,
    vector_publisher,
)
from motor_sysid.nodes.recorder import RecorderSettings
from motor_sysid.nodes.statuses import Status
from motor_sysid.recording.definitions import definitions
from motor_sysid.recording.messages import Topic

VECTOR, JOINT = 'geometry_msgs/msg/Vector3Stamped', 'sensor_msgs/msg/JointState'
SETTINGS = {
    'motor': MotorSettings,
    'pid': PidSettings,
    'identifier': IdentifierSettings,
    'recorder': RecorderSettings,
    'excitation': ExcitationSettings,
}
QUIET = {'current_noise': 0.0, 'current_bits': 0, 'encoder_counts': 0, 'current_offset': 0.0}


def overrides(**values: object) -> list[Parameter]:
    return [Parameter(name, value=value) for name, value in values.items()]


def run(done: Callable[[], object], *running: LoopNode, patience: float = PATIENCE) -> None:
    """Turn the loops of the nodes one after the other until something is so."""
    loops = [Loop(node) for node in running]

    def turn() -> bool:
        for loop in loops:
            loop.once()
        return bool(done())

    wait_for(turn, 'what the test waits for', patience)
    for loop in loops:
        loop.shutdown()


def stamp_of(message: JointState | Vector3Stamped) -> int:
    return int(message.header.stamp.sec * SECOND + message.header.stamp.nanosec)


class Listener:
    """Collects the messages of a topic, deserialised by rclpy itself."""

    def __init__(self, node: Node, topic: str, kind: type) -> None:
        names = {Vector3Stamped: VECTOR, JointState: JOINT}
        self._topic, self._kind, self.messages = RawTopic(node, topic, names[kind]), kind, []

    def __len__(self) -> int:
        self.messages += [deserialize_message(m.data, self._kind) for m in self._topic.drain()]
        return len(self.messages)

    @property
    def matched(self) -> bool:
        return self._topic.publishers > 0


# --- what is sent


def test_packed_messages_are_what_rclpy_reads(other: Node) -> None:
    vectors, joints = Listener(other, 'v', Vector3Stamped), Listener(other, 'j', JointState)
    vector = vector_publisher(other, 'v', 'dc')
    joint = joint_publisher(other, 'j', 'left', ('position', 'effort'))
    wait_for(lambda: vectors.matched and joints.matched, 'a match')
    vector.publish(7 * SECOND + 5, 1, 2.5, -3)  # ints become floats, not garbage
    joint.publish(8 * SECOND, math.pi, -1e-300)
    wait_for(lambda: len(vectors) and len(joints), 'messages')
    first, second = vectors.messages[0], joints.messages[0]
    assert (stamp_of(first), first.header.frame_id) == (7 * SECOND + 5, 'dc')
    assert (first.vector.x, first.vector.y, first.vector.z) == (1.0, 2.5, -3.0)
    assert (list(second.name), list(second.position)) == (['left'], [math.pi])
    assert (list(second.velocity), list(second.effort)) == ([], [-1e-300])


def test_packed_diagnostics_are_what_rclpy_reads() -> None:
    statuses = [Status('a', {'x': 0.1 + 0.2, 'ok': True}), Status('bé', {}, 'so so', warn=True)]
    message = deserialize_message(pack_diagnostics(3, '/node', statuses), DiagnosticArray)
    assert [s.name for s in message.status] == ['a', 'bé']
    assert [(s.level, s.message) for s in message.status] == [(b'\0', 'ok'), (b'\1', 'so so')]
    assert float(message.status[0].values[0].value) == 0.1 + 0.2
    assert message.status[0].hardware_id == '/node'


# --- parameters


@dataclass(frozen=True)
class Example:
    gain: float = parameter(1.0, 'A gain.', 'V', 0, 10, live=True)
    count: int = parameter(3, 'A count.', '', 1, 5)
    kind: str = parameter('a', 'A choice.', choices=('a', 'bee'), live=True)
    names: tuple[str, ...] = parameter((), 'Names.', live=True)


def example(context: Context, **values: object) -> tuple[Node, 'Settings[Example]']:
    node = Node(
        'example', context=context, parameter_overrides=overrides(**values),
        automatically_declare_parameters_from_overrides=True,
    )  # fmt: skip
    return node, Settings(node, Example)


def test_parameters_come_from_the_dataclass(context: Context) -> None:
    node, settings = example(context, gain=2, names=['x', ''])
    assert settings.value == Example(gain=2.0, names=('x',))
    descriptor = node.describe_parameter('gain')
    assert descriptor.description == 'A gain. [V]'
    assert descriptor.floating_point_range[0].to_value == 10.0
    assert node.describe_parameter('count').read_only
    assert node.get_parameter('names').value == ['x']
    node.destroy_node()


@pytest.mark.parametrize(
    ('given', 'message'),
    [
        ({'gian': 2.0}, 'unknown parameter `gian`; did you mean `gain`'),
        ({'gain': 11.0}, r'`gain` = 11 V is outside its range 0 to 10 V'),
        ({'gain': 'much'}, '`gain` = .much. is a str; it must be a float'),
        ({'gain': math.nan}, 'nan'),
        ({'count': 2.5}, '`count` = 2.5 is a float; it must be a int'),
        ({'kind': 'be'}, 'did you mean `bee`'),
        ({'names': [1, 2]}, 'must be a list of texts'),
        ({'use_sim_time': 'maybe'}, '`use_sim_time` = .maybe. is a str; it must be a bool'),
    ],
)
def test_bad_parameters_are_refused_by_name(
    context: Context, given: dict[str, object], message: str
) -> None:
    with pytest.raises(UserError, match=message):
        example(context, **given)


def test_live_parameters_change_and_others_do_not(context: Context) -> None:
    node, settings = example(context)
    seen: list[Example] = []
    settings.on_change(seen.append)

    def change(name: str, value: object) -> bool:
        return bool(node.set_parameters([Parameter(name, value=value)])[0].successful)

    assert change('gain', 4)
    assert change('names', ['p', 'q'])
    assert not change('gain', 40.0)
    assert not change('count', 4)
    assert not change('kind', 'c')
    assert settings.value == seen[-1] == Example(gain=4.0, names=('p', 'q'))
    assert len(seen) == 2
    node.destroy_node()


@pytest.mark.parametrize('settings', SETTINGS.values())
def test_every_parameter_has_a_sentence_and_a_range(settings: type) -> None:
    for item in fields(settings):
        spec = spec_of(item)
        assert spec.sentence.endswith('.') or spec.sentence.count(' ') > 3, item.name
        if isinstance(item.default, float | int) and not isinstance(item.default, bool):
            assert spec.low is not None, item.name
            assert spec.low <= item.default <= (spec.high or 0), item.name


# --- the motor


def test_motor_publishes_an_exact_grid_and_says_what_is_applied(
    context: Context, other: Node
) -> None:
    motor = MotorNode(context, overrides(rate=1000, seed=1))
    speed = Listener(other, 'motor/speed', JointState)
    current = Listener(other, 'motor/current', Vector3Stamped)
    voltage = Listener(other, 'motor/voltage', Vector3Stamped)
    command = vector_publisher(other, 'motor/voltage_command', 'dc')
    wait_for(lambda: speed.matched and current.matched and voltage.matched, 'a match')
    run(lambda: command.publisher.get_subscription_count(), motor)
    run(lambda: (command.publish(0, 99.0, 0.0, 0.0), len(speed) > 300)[1], motor)
    wait_for(lambda: len(voltage) == len(current) == len(speed), 'the rest')
    stamps = [stamp_of(m) for m in speed.messages]
    assert {b - a for a, b in pairwise(stamps)} == {1_000_000}
    assert (
        stamps
        == [stamp_of(m) for m in current.messages]
        == [stamp_of(m) for m in voltage.messages]
    )
    applied = [m.vector.x for m in voltage.messages]
    assert applied[0] == 0.0
    assert applied[-1] == 24.0, 'the drive is limited to its supply'
    positions = [m.position[0] for m in speed.messages]
    assert speed.messages[-1].velocity[0] == pytest.approx((positions[-1] - positions[-2]) / 1e-3)
    motor.destroy_node()


def test_motor_goes_to_zero_volts_without_commands(context: Context, other: Node) -> None:
    motor = MotorNode(context, overrides(rate=200, command_timeout=0.1, **QUIET))
    voltage = Listener(other, 'motor/voltage', Vector3Stamped)
    command = vector_publisher(other, 'motor/voltage_command', 'dc')
    run(lambda: command.publisher.get_subscription_count() and voltage.matched, motor)
    command.publish(0, 5.0, 0.0, 0.0)
    run(lambda: len(voltage) and voltage.messages[-1].vector.x == 5.0, motor)
    run(lambda: len(voltage) and voltage.messages[-1].vector.x == 0.0, motor)
    command.publish(0, math.nan, 0.0, 0.0)
    command.publish(0, -7.0, 0.0, 0.0)
    run(lambda: len(voltage) and voltage.messages[-1].vector.x == -7.0, motor)
    motor.close()
    wait_for(lambda: len(voltage) and voltage.messages[-1].vector.x == 0.0, '0 V at the end')
    motor.destroy_node()


def test_motor_follows_simulated_time(context: Context, other: Node) -> None:
    motor = MotorNode(context, overrides(rate=100, use_sim_time=True))
    speed = Listener(other, 'motor/speed', JointState)
    clock = other.create_publisher(Clock, '/clock', 10)
    wait_for(lambda: clock.get_subscription_count() and speed.matched, 'a match')

    def tell(seconds: float) -> None:
        message = Clock()
        nanoseconds = round(seconds * SECOND)
        message.clock.sec, message.clock.nanosec = divmod(nanoseconds, SECOND)
        clock.publish(message)

    loop = Loop(motor)
    for _ in range(20):
        loop.once()
    assert len(speed) == 0, 'no time, no samples'
    for tick in range(11):
        tell(100 + 0.05 * tick)
        due = 1 + 5 * tick
        wait_for(lambda due=due: (loop.once(), len(speed) >= due)[1], f'sample {due}')
    assert [stamp_of(m) for m in speed.messages] == [
        100 * SECOND + k * 10_000_000 for k in range(51)
    ]
    loop.shutdown()
    motor.destroy_node()


def test_hidden_effects_may_come_while_the_motor_turns(context: Context, other: Node) -> None:
    motor = MotorNode(context, overrides(rate=200, command_timeout=10.0, **QUIET))
    speed = Listener(other, 'motor/speed', JointState)
    command = vector_publisher(other, 'motor/voltage_command', 'dc')
    run(lambda: command.publisher.get_subscription_count() and speed.matched, motor)
    command.publish(0, 6.0, 0.0, 0.0)
    run(lambda: len(speed) and speed.messages[-1].velocity[0] > 100, motor)
    before = speed.messages[-1].velocity[0]
    result = motor.set_parameters(overrides(hidden_effects=['coulomb_friction', 'witch']))[0]
    assert not result.successful
    assert 'witch' in result.reason
    assert motor.set_parameters(overrides(
        hidden_effects=['coulomb_friction'], hidden_parameters=['coulomb_friction.tau_c=0.1']
    ))[0].successful  # fmt: skip
    run(lambda: len(speed) and speed.messages[-1].velocity[0] < 0.7 * before, motor)
    assert max(m.velocity[0] for m in speed.messages) < 130, 'the state goes on without a jump'
    motor.destroy_node()


# --- the controller


def test_loop_follows_a_reference_that_reverses(context: Context, other: Node) -> None:
    motor = MotorNode(context, overrides(hidden_effects=['coulomb_friction']))
    pid = PidNode(context)
    speed = Listener(other, 'motor/speed', JointState)
    reference = vector_publisher(other, 'motor/reference', 'speed')
    wait_for(lambda: speed.matched and reference.publisher.get_subscription_count(), 'a match')
    for level in (80.0, -80.0):
        reference.publish(0, level, 0.0, 0.0)
        run(lambda: len(speed) and abs(speed.messages[-1].velocity[0] - level) < 8, motor, pid)  # noqa: B023
    for node in (motor, pid):
        node.destroy_node()


def test_profile_is_published_with_the_stamps_of_the_samples(
    context: Context, other: Node
) -> None:
    motor = MotorNode(context)
    pid = PidNode(context, overrides(
        profile='reversals', profile_duration=1.0, top_speed=60.0, autostart=False
    ))  # fmt: skip
    speed = Listener(other, 'motor/speed', JointState)
    reference = Listener(other, 'motor/reference', Vector3Stamped)
    command = Listener(other, 'motor/voltage_command', Vector3Stamped)
    wait_for(lambda: all(x.matched for x in (speed, reference, command)), 'a match')
    run(lambda: len(speed) > 20 and len(reference) and len(command), motor, pid)
    assert {m.vector.x for m in reference.messages + command.messages} == {0.0}, 'it waits'
    start = other.create_client(Trigger, '/pid/start')
    wait_for(start.service_is_ready, 'the service')
    start.call_async(Trigger.Request())
    run(lambda: len(reference) and stamp_of(reference.messages[-1])
        > stamp_of(reference.messages[0]) + 1.2 * SECOND, motor, pid)  # fmt: skip
    wait_for(lambda: len(speed) and len(command) == len(reference), 'the rest')
    stamps = {stamp_of(m) for m in speed.messages}
    assert {stamp_of(m) for m in reference.messages} <= stamps
    assert [stamp_of(m) for m in reference.messages] == [stamp_of(m) for m in command.messages]
    values = [m.vector.x for m in reference.messages]
    assert max(values) == pytest.approx(30.0)
    assert min(values) == pytest.approx(-24.0)
    assert values[0] == values[-1] == 0.0
    assert max(abs(m.velocity[0]) for m in speed.messages) > 20
    pid.close()
    wait_for(lambda: len(command) and command.messages[-1].vector.x == 0.0, '0 V at the end')
    assert [m.vector.x for m in command.messages[-3:]] == [0.0] * 3
    for node in (motor, pid):
        node.destroy_node()


# --- the identifier


def test_identifier_finds_types_by_itself_and_publishes_what_it_estimates(
    context: Context, other: Node
) -> None:
    identifier = IdentifierNode(context, overrides(msg_config='default', nominal=['R=2.2']))
    motor = MotorNode(context, overrides(rate=200))
    pid = PidNode(context, overrides(profile='steps', profile_duration=30.0))
    names = ('identifier/prediction', 'identifier/residual')
    prediction, residual = (Listener(other, name, JointState) for name in names)
    estimate = RawTopic(other, 'identifier/estimate', 'diagnostic_msgs/msg/DiagnosticArray')
    arrays: list[DiagnosticArray] = []

    def look() -> int:
        arrays.extend(deserialize_message(m.data, DiagnosticArray) for m in estimate.drain())
        return len(arrays)

    run(lambda: look() > 2 and len(residual) > 5 and len(prediction), motor, pid, identifier)
    head, *parameters = arrays[-1].status
    values = {pair.key: pair.value for pair in head.values}
    assert head.name == 'samples'
    assert int(values['samples']) % 20 == 1, 'ten a second at 200 Hz, at exact sample times'
    assert {'R', 'L', 'k_t', 'J', 'b'} <= {status.name for status in parameters}
    for status in parameters:
        found = {pair.key: pair.value for pair in status.values}
        assert set(found) == {'value', 'sigma', 'unit', 'identifiable'}
        assert float(found['sigma']) >= 0
    assert (
        stamp_of(residual.messages[-1]) % 5_000_000 == stamp_of(residual.messages[0]) % 5_000_000
    )
    assert len(residual.messages[0].velocity) == len(residual.messages[0].effort) == 1
    for node in (motor, pid, identifier):
        node.close()
        node.destroy_node()


def test_identifier_refuses_what_cannot_be_estimated(context: Context) -> None:
    for given, message in (
        ({'nominal': ['R=-1']}, 'R'),
        ({'model_file': '/nowhere.yaml'}, '/nowhere.yaml'),
        ({'msg_config': 'emps'}, 'voltage|current|speed'),
        ({'motor': 'brushed_ac'}, 'one of brushed_dc'),
    ):
        with pytest.raises(UserError, match=message):
            IdentifierNode(context, overrides(**given))


# --- intake


def test_a_best_effort_publisher_is_heard(context: Context, other: Node) -> None:
    topic = RawTopic(other, 'foreign', VECTOR)
    qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    sensor = vector_publisher(other, 'foreign', 'dc', qos)
    wait_for(lambda: other.count_publishers('foreign'), 'discovery')
    wait_for(topic.adapt, 'the weaker offer')
    wait_for(lambda: sensor.publisher.get_subscription_count(), 'a match')
    assert not topic.adapt()
    sensor.publish(5, 1.0, 0.0, 0.0)
    wait_for(lambda: topic.received or topic.drain(), 'a message')


@pytest.mark.parametrize(
    ('kind', 'topic', 'heard'),
    [
        (PidNode, 'motor/reference', lambda node: node._given.value),
        (MotorNode, 'motor/voltage_command', lambda node: node._command),
    ],
    ids=['reference', 'command'],
)
def test_a_best_effort_reference_or_command_is_heard(
    context: Context, other: Node, kind: type[LoopNode], topic: str, heard: Callable[..., float]
) -> None:
    node = kind(context)
    qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    sender = vector_publisher(other, topic, '', qos)
    run(lambda: (sender.publish(0, 5.0, 0.0, 0.0), heard(node) == 5.0)[1], node)
    node.destroy_node()


def test_a_middleware_without_times_and_numbers_will_do(other: Node) -> None:
    topic = RawTopic(other, 'plain', VECTOR)
    sender = vector_publisher(other, 'plain', 'dc')
    wait_for(lambda: topic.publishers, 'a match')
    real = topic._subscription

    class Plain(nullcontext[None]):
        """A handle as of CycloneDDS: it numbers nothing and does not tell when a message came."""

        def take_message(self, kind: type, raw: bool) -> object:
            with real.handle:
                taken = real.handle.take_message(kind, raw)
            nothing = {'received_timestamp': 0, 'publication_sequence_number': None}
            return taken and (taken[0], nothing)

    topic._subscription = SimpleNamespace(handle=Plain())
    begin = time.time_ns()
    for k in (1, 2, 5):
        sender.publish(k, 1.0, 0.0, 0.0)
    messages = []
    wait_for(lambda: (messages.extend(topic.drain()), len(messages) == 3)[1], 'the messages')
    assert (topic.received, topic.lost) == (3, 0)
    assert all(begin <= m.received <= time.time_ns() for m in messages)
    topic._subscription = real


def test_messages_that_the_queue_lost_are_counted(other: Node) -> None:
    topic = RawTopic(other, 'fast', VECTOR, QoSProfile(depth=10))
    fast = vector_publisher(other, 'fast', 'dc', STREAM)
    wait_for(lambda: topic.publishers, 'a match')
    fast.publish(0, 0.0, 0.0, 0.0)
    wait_for(topic.drain, 'the first')
    for k in range(1, 101):
        fast.publish(k, 0.0, 0.0, 0.0)
    wait_for(lambda: topic.drain() or topic.received > 1, 'the last ones')
    wait_for(lambda: topic.drain() or topic.received + topic.lost == 101, 'all')
    assert topic.lost >= 80


def test_two_publishers_on_one_topic_are_no_loss(other: Node) -> None:
    topic = RawTopic(other, 'shared', VECTOR)
    writers = [vector_publisher(other, 'shared', 'dc') for _ in range(2)]
    wait_for(lambda: topic.publishers == 2, 'a match')
    for k in range(30):
        for j, writer in enumerate(writers):
            if k >= 5 * j:
                writer.publish(k, 0.0, 0.0, 0.0)
    wait_for(lambda: topic.drain() or topic.received == 55, 'all')
    assert topic.lost == 0


@pytest.mark.parametrize(
    'name',
    ['sensor_msgs/msg/JointState', 'sensor_msgs/msg/Imu', 'sensor_msgs/msg/BatteryState',
     'nav_msgs/msg/Odometry', 'diagnostic_msgs/msg/DiagnosticArray', 'std_msgs/msg/Float64'],
)  # fmt: skip
def test_installed_types_are_those_that_bags_store(name: str) -> None:
    assert definitions([Topic(name, name)]).items() >= installed_types(name).items()


def test_a_message_type_that_is_not_installed_is_named(other: Node) -> None:
    with pytest.raises(UserError, match='dynamixel_msgs'):
        RawTopic(other, 'x', 'dynamixel_msgs/msg/State')


@pytest.mark.parametrize(('name', 'kind'), SETTINGS.items())
def test_config_files_list_every_parameter(repository: Path, name: str, kind: type) -> None:
    text = (repository / 'config' / f'{name}.yaml').read_text()
    assert text == config_yaml(name, kind), 'write it anew with config_yaml()'
    given = yaml.safe_load(text)['/**']['ros__parameters']
    assert {item.name: checked(item, given[item.name]) for item in fields(kind)} == {
        item.name: item.default for item in fields(kind)
    }
