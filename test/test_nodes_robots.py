"""The topics of robots as they are: what they lack, at which rates, and who else is there."""

from collections.abc import Mapping
from dataclasses import replace

from bench_motor import MOTOR
import numpy as np
import pytest
from recording_tools import joints, motor_topics, START, Topic
from slow_motor import sampled

from motor_sysid.nodes.configuration import Configuration
from motor_sysid.nodes.pipeline import Pipeline
from motor_sysid.nodes.topics import DEFAULT_SOURCES
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.recording.sources import Source
from motor_sysid.signals.record import Record

SECOND = 1_000_000_000
JOINT = 'sensor_msgs/msg/JointState'
VOLTAGE, CURRENT, SPEED = '/motor/voltage', '/motor/current', '/motor/speed'


def pipeline(
    estimator: str = 'rls', sources: tuple[Source, ...] = DEFAULT_SOURCES
) -> Pipeline:
    """Return what an identifier works with whose start values are off by 30 %."""
    start = {name: 1.3 * value for name, value in MOTOR.items()}
    model = Model.base('brushed_dc', start, speed_sensor=SpeedSensor.DIFFERENCE)
    given = Configuration(model, estimator)
    plan = given.plan(sources)
    return given.pipeline(plan, [topic.reader() for topic in plan.topics], 20_000)


def push(target: Pipeline, topics: Mapping[str, Topic]) -> None:
    """Push all messages in the order of reception."""
    numbers = {f'/{t.topic.lstrip("/")}': k for k, t in enumerate(target.plan.topics)}
    rows = [(at, numbers[name], data) for name, (_, own) in topics.items() for at, data in own]
    for k, (received, topic, data) in enumerate(sorted(rows, key=lambda row: row[:2])):
        target.push(topic, data, received)
        if k % 13 == 0:
            target.advance()
    target.advance()


def is_found(target: Pipeline, within: float = 0.05) -> None:
    """Check that R, k_t and J are known, and right."""
    estimate = target.stream.estimate()
    for name in ('R', 'k_t', 'J'):
        assert estimate[name][3], name
        assert estimate[name][0] == pytest.approx(MOTOR[name], rel=within), name


def stamps(record: Record) -> list[int]:
    return (START + np.round(record.time * SECOND)).astype(np.int64).tolist()


@pytest.mark.parametrize('estimator', ['rls', 'ekf'])
def test_joint_states_without_positions_are_enough(estimator: str) -> None:
    """Every sample was waited with for a position that never came."""
    record = sampled('steps', 0, (), {}).slice(0, 3000)
    both = zip(stamps(record), record['speed'], strict=True)
    messages = [(s, joints(s, ['m'], [], [w])) for s, w in both]
    target = pipeline(estimator)
    push(target, {**motor_topics(record), SPEED: (JOINT, messages)})
    is_found(target)


def every_second(record: Record) -> dict[str, Topic]:
    """Return the topics of a drive, and of joint states of every second of its cycles."""
    topics = motor_topics(record)
    kind, messages = topics[SPEED]
    return {**topics, SPEED: (kind, messages[::2])}


def test_topics_of_every_second_cycle_lose_no_message_of_the_others() -> None:
    """Their stamps are equal to half of the others': these were the samples, with wrong inputs."""
    record = sampled('steps', 0, (), {}).slice(0, 4000)
    target = pipeline()
    push(target, every_second(record))
    assert target.join.clock == 'motor/voltage'
    assert target.join.counts.dropped == 0
    assert target.join.counts.joined >= 3990
    is_found(target, 0.02)


def with_gripper(record: Record) -> dict[str, Topic]:
    """Return topics with another node's joint on that of the joint states, in their way."""
    times = stamps(record)
    rows = zip(times, record['position'], record['speed'], strict=True)
    own = [(s, joints(s, ['elbow'], [p], [w])) for s, p, w in rows]
    other = [(s, joints(s, ['gripper'], [0.1], [0.0])) for s in times[::4]]
    return {**motor_topics(record), SPEED: (JOINT, own[:1] + other + own[1:])}


NAMED = tuple(
    replace(one, field=one.field.replace('[0]', '[name=elbow]')) for one in DEFAULT_SOURCES
)


@pytest.mark.parametrize('sources', [NAMED, DEFAULT_SOURCES], ids=['by_name', 'by_place'])
def test_another_joint_on_the_same_topic_is_left_out(sources: tuple[Source, ...]) -> None:
    """At each fourth stamp the gripper's message came first, and the elbow's was out of order."""
    record = sampled('steps', 0, (), {}).slice(0, 3000)
    target = pipeline(sources=sources)
    push(target, with_gripper(record))
    assert target.foreign == (0, 0, 750)
    assert target.join.counts.joined == 3000
    assert target.join.counts.dropped == target.not_finite == 0
    is_found(target)
    doubts = [
        '`motor/speed` has messages of another joint, too (gripper); the one that came first is '
        'taken, which may be another motor than the one that the voltage belongs to. Choose in a '
        'msg_config file, e.g. `field: velocity[name=elbow]`'
    ]
    assert target.doubts == ([] if sources is NAMED else doubts)


def test_the_joint_that_comes_first_is_followed_through_changing_orders() -> None:
    target = pipeline()
    for k, names in enumerate((['arm.elbow', 'wrist'], ['wrist', 'arm.elbow'], ['wrist'])):
        values = {'arm.elbow': 10.0 + k, 'wrist': 20.0 + k}
        motion = [values[name] for name in names]
        target.push(2, joints(k, names, motion, motion), 0)
    assert [row[1][0] for row in target.join._first[2]] == [10.0, 11.0]
    (doubt,) = target.doubts
    assert '`motor/speed` carries 2 joints (arm.elbow, wrist); the one' in doubt
    assert '`field: velocity[name=arm.elbow]`' in doubt
