"""The topics of robots as they are: what they lack, at which rates, and who else is there."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from bench_motor import MOTOR
import numpy as np
import pytest
from recording_tools import joints, motor_topics, START, Topic, vector
from slow_motor import sampled

from motor_sysid.errors import UserError
from motor_sysid.nodes import joining
from motor_sysid.nodes.configuration import Configuration
from motor_sysid.nodes.pipeline import Pipeline
from motor_sysid.nodes.topics import DEFAULT_SOURCES
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.simulate import simulate
from motor_sysid.recording.sources import Source
from motor_sysid.signals.record import Record

SECOND, MIDDLE = 1_000_000_000, 650_000
VECTOR, JOINT = 'geometry_msgs/msg/Vector3Stamped', 'sensor_msgs/msg/JointState'
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


def push(target: Pipeline, topics: Mapping[str, Topic], every: int = 13) -> None:
    """Push all messages in the order of reception, and look at them now and then."""
    numbers = {f'/{t.topic.lstrip("/")}': k for k, t in enumerate(target.plan.topics)}
    rows = [(at, numbers[name], data) for name, (_, own) in topics.items() for at, data in own]
    for k, (received, topic, data) in enumerate(sorted(rows, key=lambda row: row[:2])):
        target.push(topic, data, received)
        if k % every == 0:
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


@pytest.mark.parametrize('lacking', ['speed', 'position'])
@pytest.mark.parametrize('estimator', ['rls', 'ekf'])
def test_joint_states_without_positions_or_speeds_are_enough(
    estimator: str, lacking: str
) -> None:
    """Every sample was waited with for a position that never came."""
    record = sampled('steps', 0, (), {}).slice(0, 3000)
    rows = zip(stamps(record), record['position'], record['speed'], strict=True)
    messages = [
        (s, joints(s, ['m'], [p] if lacking == 'speed' else [], [] if lacking == 'speed' else [w]))
        for s, p, w in rows
    ]
    target = pipeline(estimator)
    push(target, {**motor_topics(record), SPEED: (JOINT, messages)})
    is_found(target)
    window = target.record()
    assert window is not None
    assert (len(window), target.not_finite) == (3000, 0)
    assert set(window) == {'voltage', 'current', 'speed', 'position'} - {lacking}


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


POWERED = (
    Source('voltage', product=('duty', 'supply_voltage')),
    Source('duty', topic='motor/voltage', type=VECTOR, field='vector.x', scale=1 / 24),
    Source('supply_voltage', topic='battery', type=VECTOR, field='vector.x'),
    *DEFAULT_SOURCES[1:],
)


def beside_a_battery(record: Record, period: float) -> dict[str, Topic]:
    """Return topics with that of a battery that is measured every so many seconds."""
    first, last = stamps(record)[0], stamps(record)[-1]
    times = range(first + 1_234_567, last, round(period * SECOND))
    return {**motor_topics(record), '/battery': (VECTOR, [(s, vector(s, 24.0)) for s in times])}


@pytest.mark.parametrize('period', [0.3, 1.2])
def test_a_battery_that_is_measured_seldom_is_waited_for_three_times(period: float) -> None:
    """Twenty of its messages never lay among the last 4096 of the drive."""
    record = sampled('steps', 0, (), {})
    target = pipeline(sources=POWERED)
    push(target, beside_a_battery(record, period))
    assert target.join.clock == 'motor/voltage'
    assert target.join.counts.dropped == 0
    assert target.join.counts.joined >= record.time.size - 1300 * period
    is_found(target, 0.02)


def test_looking_for_how_to_join_costs_little_while_a_topic_is_awaited(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Stamps were compared at each look, thousands at a time."""
    looks: list[int] = []
    count = joining._with_partners

    def counted(own: Sequence[Sequence[int]]) -> int:
        looks.append(sum(map(len, own)))
        return count(own)

    monkeypatch.setattr(joining, '_with_partners', counted)
    record = sampled('steps', 0, (), {}).slice(0, 3000)
    push(pipeline(sources=POWERED), beside_a_battery(record, 0.9))
    assert len(looks) == 1


def test_a_voltage_that_was_sent_once_before_all_else_holds() -> None:
    record = sampled('steps', 0, (), {}).slice(0, joining.LONG + 800)
    topics, first = motor_topics(record), stamps(record)[0] - 5_000_000
    topics[VOLTAGE] = (VECTOR, [(first, vector(first, 6.0))])
    target = pipeline()
    push(target, topics)
    assert target.join.clock == 'motor/speed'
    assert target.join.counts.joined > joining.LONG + 500
    assert set(target.window.last()[1][:, 0]) == {6.0}


def test_the_choice_and_the_rows_depend_on_the_messages_alone() -> None:
    """Not on when one looked: the stamps of the drive jitter, and its period was their median."""
    rng, record = np.random.default_rng(5), sampled('steps', 0, (), {}).slice(0, 600)
    shaken = replace(record, time=record.time + rng.uniform(0, 7e-4, record.time.size))
    rows = list(zip(stamps(record), record['position'], record['speed'], strict=True))[::3]
    own = [(s + MIDDLE, joints(s + MIDDLE, ['m'], [p], [w])) for s, p, w in rows]
    topics = {**motor_topics(shaken), SPEED: (JOINT, own)}
    soon, late = pipeline('ekf'), pipeline('ekf')
    push(soon, topics)
    push(late, topics, every=700)
    (stamps_of, values), (others, same) = soon.window.last(), late.window.last()
    assert np.array_equal(stamps_of, others)
    assert np.array_equal(values, same)
    assert soon.stream.estimate() == late.stream.estimate()


def without(*signals: str) -> tuple[Source, ...]:
    """Return the default sources but those of some signals."""
    return tuple(source for source in DEFAULT_SOURCES if source.signal not in signals)


@pytest.mark.parametrize('lacking', ['speed', 'position', 'current'])
def test_a_signal_may_lack_a_source_where_the_estimator_can_do_without(lacking: str) -> None:
    record = sampled('steps', 0, (), {}).slice(0, 4000)
    topics = motor_topics(record)
    target = pipeline('ekf', without(lacking))
    assert lacking not in target.signals
    numbers = [f'/{name}' for name in target.plan.names]
    push(target, {name: topics[name] for name in numbers})
    assert target.stream.samples == 4000
    if lacking != 'current':
        is_found(target)


@pytest.mark.parametrize(
    ('kind', 'lacking', 'message'),
    [
        ('brushed_dc', ['speed', 'position'], 'no topic carries `speed` or `position`; name'),
        ('brushed_dc', ['current'], 'needs `i` measured; name the topic for it, or use the est'),
        ('brushed_dc', ['voltage'], 'no topic carries `voltage`; name one in the msg_config'),
        ('bldc', ['position'], 'no topic carries `position`'),
        ('mechanical_axis', ['current'], '`torque` or `force` or `current` or `current_q`; name'),
    ],
)
def test_what_cannot_be_missed_is_named(kind: str, lacking: list[str], message: str) -> None:
    sources = without(*lacking, *(['current_q'] if kind == 'mechanical_axis' else []))
    with pytest.raises(UserError, match=message):
        Configuration(Model.base(kind)).plan(sources)


@pytest.mark.parametrize('drive', ['torque', 'force', 'current', 'current_q'])
def test_an_axis_is_driven_by_what_the_file_has(drive: str) -> None:
    time = 1e-3 * np.arange(4000)
    push_of = 0.5 * np.sign(np.sin(2 * np.pi * 2 * time)) + 0.1 * np.sin(40 * time)
    axis = Model.base('mechanical_axis', {'J': 2e-3, 'b': 4e-3}, speed_sensor=SpeedSensor.IDEAL)
    run = simulate(axis, Record(time, {'torque': push_of}, {'torque': 'N m'})).outputs
    signals = {'voltage': push_of, 'current': push_of, **run}
    units = {'voltage': 'V', 'current': 'A', 'speed': 'rad/s', 'position': 'rad'}
    topics = motor_topics(Record(time, signals, units))
    sources = tuple(
        replace(source, signal=drive) if source.signal == 'voltage' else source
        for source in without('current', 'current_q')
    )
    given = Configuration(axis.with_values({'J': 3e-3, 'b': 2e-3}))
    plan = given.plan(sources)
    target = given.pipeline(plan, [topic.reader() for topic in plan.topics], 5000)
    push(target, {f'/{name}': topics[f'/{name}'] for name in plan.names})
    estimate = target.stream.estimate()
    assert estimate['J'][0] == pytest.approx(2e-3, rel=0.02)
    assert estimate['b'][0] == pytest.approx(4e-3, rel=0.05)
