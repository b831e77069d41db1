"""The topics of robots as they are: what they lack, at which rates, and who else is there."""

from collections.abc import Mapping

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
    numbers = {f'/{t.topic.lstrip("/")}': k for k, t in enumerate(target._plan.topics)}
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
