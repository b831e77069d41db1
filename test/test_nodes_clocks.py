"""Topics that do not share their stamps, live: joined as those of a bag are."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING

from bench_motor import MOTOR
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
import pytest
from recording_tools import joints, motor_record, motor_topics, START, Topic, vector, write_bag
from slow_motor import sampled

from motor_sysid.estimation.online import OnlineIdentifier
from motor_sysid.nodes.configuration import Configuration
from motor_sysid.nodes.joining import LONG
from motor_sysid.nodes.pipeline import Pipeline
from motor_sysid.nodes.replay import replay
from motor_sysid.nodes.topics import DEFAULT_SOURCES
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.recording.align import align, Series
from motor_sysid.recording.load import load
from motor_sysid.signals.channels import Role
from motor_sysid.signals.clock_join import Clock, ClockJoin, PATIENCE, Sample
from motor_sysid.signals.join import JoinCounts
from motor_sysid.signals.record import Record, Samples

if TYPE_CHECKING:
    from collections.abc import Callable

    from rclpy.node import Node

    from motor_sysid.nodes.loop import LoopNode

MS, SECOND = 1_000_000, 1_000_000_000
TURN = 2 * np.pi
VECTOR, JOINT = 'geometry_msgs/msg/Vector3Stamped', 'sensor_msgs/msg/JointState'
TOPICS = ('/motor/voltage', '/motor/current', '/motor/speed')
MEASURED, INPUT, STEPPED = Role.MEASURED, Role.INPUT, Role.STEPPED


# --- the join


def clocks(*roles: Role, period: int = MS, reach: int | None = 10 * MS) -> list[Clock]:
    return [Clock((role,), period, None if role is STEPPED else reach) for role in roles]


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**31), st.lists(st.integers(0, 3), max_size=300),
    st.sampled_from([0, 1, 2]),
)  # fmt: skip
def test_rows_are_those_of_a_bag_whatever_the_order_of_arrival(
    seed: int, order: list[int], base: int
) -> None:
    """Four topics with jitter, losses and periods of 1, 1, 3 and 7 ms."""
    rng = np.random.default_rng(seed)
    names = ('voltage', 'current', 'speed', 'speed_reference')
    roles, periods = (INPUT, MEASURED, MEASURED, STEPPED), (1, 1, 3, 7)
    series, known = [], []
    for name, period, role in zip(names, periods, roles, strict=True):
        stamps = period * (np.arange(210 // period) + rng.uniform(0, 0.6, 210 // period))
        kept = rng.random(stamps.size) > 0.02
        kept[0] = True
        own = np.round(stamps[kept] * MS).astype(np.int64)
        series.append(Series(name, own, own, {name: rng.normal(size=own.size)}))
        known += clocks(role, period=period * MS)
    expected, _ = align(series, series[base], dict.fromkeys(names, 'V'))
    counts = JoinCounts()
    join = ClockJoin(known, base, counts)
    sent, rows = [0] * 4, list[Sample]()
    for topic in [*order, *(k for k in range(4) for _ in range(250))]:
        one = series[topic]
        if sent[topic] < one.stamps.size:
            value = float(one.signals[one.topic][sent[topic]])
            join.push(topic, int(one.stamps[sent[topic]]), (value,))
            sent[topic] += 1
            rows += join.pop()
    whole = expected[0]
    time = np.array([row.stamp for row in rows]) - series[base].stamps[0]
    assert time.size > 180 / periods[base]
    assert np.array_equal(time, np.round(whole.time * SECOND)[: time.size])
    alone = np.diff(whole.time, append=np.inf)[: time.size] < 1.4e-3 * periods[base]
    for k, name in enumerate(names):
        found = np.array([row.values[k] for row in rows])
        # a bag's row reaches over a message that is lost, a live one ends after a period
        these = alone if name == 'voltage' and base else np.ones_like(alone)
        assert np.mean(these) > 0.7
        assert found[these] == pytest.approx(whole.signals[name][: time.size][these], abs=1e-9)
    assert counts.joined == time.size
    assert counts.dropped == 0


def test_every_message_of_a_slow_topic_is_fresh_in_one_row() -> None:
    join = ClockJoin(clocks(INPUT, MEASURED, reach=20 * MS), 0, JoinCounts())
    for k in range(200):
        join.push(0, k * MS, (1.0,))
    own = [10 * MS * k + MS // 3 + (k % 3) * MS // 4 for k in range(20)]
    for stamp in own:
        join.push(1, stamp, (float(stamp),))
    rows = join.pop()
    fresh = [row.stamp for row in rows if row.fresh[1]]
    assert fresh == [MS * round(stamp / MS) for stamp in own[1:-1]]
    assert [row.values[1] for row in rows] == pytest.approx([row.stamp for row in rows])


def test_an_input_that_changes_within_a_row_is_averaged_over_it() -> None:
    join = ClockJoin(clocks(MEASURED, INPUT), 0, JoinCounts())
    for k in range(6):
        join.push(0, k * MS, (0.0,))
        join.push(1, k * MS + MS // 4, (float(k),))
    assert [row.values[1] for row in join.pop()] == pytest.approx([0.75, 1.75, 2.75, 3.75])


def test_what_lies_between_two_messages_too_far_apart_is_dropped_and_counted() -> None:
    counts = JoinCounts()
    join = ClockJoin(clocks(INPUT, MEASURED), 0, counts)
    for k in range(100):
        join.push(0, k * MS, (0.0,))
        if not 30 < k < 60:
            join.push(1, k * MS, (0.0,))
    rows = join.pop()
    assert counts.incomplete == counts.dropped == 29
    assert [row.stamp // MS for row in rows] == [*range(31), *range(60, 100)]


def test_an_input_that_is_sent_on_change_holds() -> None:
    counts = JoinCounts()
    join = ClockJoin(
        [Clock((MEASURED,), MS, 10 * MS), Clock((INPUT,), 0, None)], 0, counts
    )  # fmt: skip
    join.push(1, -MS, (3.0,))
    for k in range(1500):
        join.push(0, k * MS, (0.0,))
    rows = join.pop()
    assert len(rows) == 1500 - PATIENCE // MS
    assert {row.values[1] for row in rows} == {3.0}
    join.push(1, 1480 * MS, (7.0,))
    join.push(1, 1600 * MS, (8.0,))
    rows += join.pop()
    assert [row.stamp // MS for row in rows] == list(range(1499))
    assert [row.values[1] for row in rows[-20:]] == [3.0] + [7.0] * 19
    assert counts.dropped == 0


def test_rows_begin_where_every_topic_is_heard_and_anew_after_a_restart() -> None:
    counts = JoinCounts()
    join = ClockJoin(clocks(INPUT, MEASURED), 0, counts, limit=50)
    for k in range(80):
        join.push(0, (5000 + k) * MS, (0.0,))
    for k in range(70, 80):
        join.push(1, (5000 + k) * MS, (0.0,))
    rows = join.pop()
    for k in range(5):
        for topic in range(2):
            join.push(topic, k * MS, (1.0,))
    join.push(1, 3 * MS, (1.0,))
    assert [row.stamp // MS for row in rows + join.pop()] == [*range(5070, 5080), *range(5)]
    assert (counts.early, counts.restarts, counts.out_of_order) == (70, 1, 1)
    assert counts.dropped == 1


# --- the choice, and the whole


def topics_of(record: Record, wrapped: bool = False) -> dict[str, Topic]:
    """Return the topics that say what a record holds, each with the stamps that it has."""
    volts, amps, speed = (
        record.samples.get(name, Samples(record.time, record[name]))
        for name in ('voltage', 'current', 'speed')
    )
    place = record.samples.get('position', Samples(record.time, record['position'])).values
    place = place % TURN if wrapped else place

    def stamps(own: Samples) -> list[int]:
        return (START + np.round(own.time * SECOND)).astype(np.int64).tolist()

    def vectors(own: Samples) -> Topic:
        return VECTOR, [(s, vector(s, x)) for s, x in zip(stamps(own), own.values, strict=True)]

    motion = zip(stamps(speed), place, speed.values, strict=True)
    return {
        TOPICS[0]: vectors(volts),
        TOPICS[1]: vectors(amps),
        TOPICS[2]: (JOINT, [(s, joints(s, ['m'], [p], [w])) for s, p, w in motion]),
    }


def configuration(estimator: str = 'rls', sensor: str = 'difference') -> Configuration:
    start = {name: 1.3 * value for name, value in MOTOR.items()}
    model = Model.base('brushed_dc', start, speed_sensor=SpeedSensor(sensor))
    return Configuration(model, estimator)


def pipeline(given: Configuration | None = None, base_clock: str = '') -> Pipeline:
    given = given or configuration()
    plan = given.plan(DEFAULT_SOURCES, base_clock)
    order = [TOPICS.index(f'/{topic.topic}') for topic in plan.topics]
    assert order == [0, 1, 2]
    return given.pipeline(plan, [topic.reader() for topic in plan.topics], 20_000)


def push(target: Pipeline, topics: Mapping[str, Topic], first: int = 0) -> None:
    """Push all messages by reception, from a time (ns) on."""
    rows = sorted((s, TOPICS.index(name), d) for name, (_, m) in topics.items() for s, d in m)
    for k, (received, topic, data) in enumerate(rows):
        if received >= first:
            target.push(topic, data, received)
            if k % 13 == 0:
                target.advance()
    target.advance()


def record_of(target: Pipeline) -> Record:
    record = target.record()
    assert record is not None
    return record


def test_equal_stamps_are_joined_as_such() -> None:
    target = pipeline()
    push(target, motor_topics(motor_record(300)))
    assert target.join.clock == ''
    assert target.join.counts.joined == len(record_of(target)) == 300
    assert not record_of(target).samples


def test_a_slow_topic_on_the_stamps_of_a_fast_one_has_its_own_clock() -> None:
    topics = motor_topics(motor_record(400))
    topics['/motor/speed'] = (JOINT, topics['/motor/speed'][1][::10])
    target = pipeline()
    push(target, topics)
    record = record_of(target)
    assert target.join.clock == 'motor/voltage'
    assert len(record) == 391
    assert record.samples.keys() == {'speed', 'position'}


def test_a_few_messages_that_are_lost_at_the_start_change_nothing() -> None:
    topics = motor_topics(motor_record(400))
    kind, messages = topics['/motor/current']
    topics['/motor/current'] = (kind, [m for k, m in enumerate(messages) if k not in (1, 2, 7)])
    target = pipeline()
    push(target, topics)
    assert target.join.clock == ''
    assert target.join.counts.joined == 397


@pytest.mark.parametrize('wrapped', [False, True])
@pytest.mark.parametrize('slow', [('speed', 'position'), ('current', 'speed', 'position')])
def test_the_window_holds_what_a_bag_of_the_same_messages_does(
    tmp_path: Path, slow: tuple[str, ...], wrapped: bool
) -> None:
    """The same rows, and the same samples between them, in the same order of topics."""
    topics = topics_of(sampled('steps', 0, slow, {}).slice(0, 3000), wrapped)
    target = pipeline()
    push(target, topics)
    live = record_of(target)
    (read,) = load(write_bag(tmp_path / 'bag', topics)).records
    assert live.samples.keys() == read.samples.keys() == set(slow)
    count = len(live)
    assert len(read) - 2 <= count <= len(read)
    skipped = round((read.duration - live.duration) / read.dt)
    assert skipped <= 2
    for name in ('voltage', 'current', 'speed', 'position'):
        shift = round((live[name][0] - read[name][0]) / TURN) * TURN if name == 'position' else 0.0
        assert live[name] - shift == pytest.approx(read[name][:count], abs=1e-9), name
        if name in slow:
            own, other = live.samples[name], read.samples[name]
            size = min(own.time.size, other.time.size)
            assert size >= other.time.size - 1
            assert own.time[:size] + read.time[0] == pytest.approx(other.time[:size], abs=1e-8)
            assert own.values[:size] - shift == pytest.approx(other.values[:size], abs=1e-9)


def test_the_signal_named_as_base_clock_gives_the_rows() -> None:
    topics = motor_topics(motor_record(400), lag=300_000)
    target = pipeline(base_clock='speed')
    push(target, topics)
    assert target.join.clock == 'motor/speed'
    assert not {'speed', 'position'} & record_of(target).samples.keys()
    assert configuration().plan(DEFAULT_SOURCES, 'torque').base_clock == '', 'it is not read'


def test_a_voltage_that_is_sent_on_change_is_enough() -> None:
    sent = motor_record(LONG + 1500)
    topics = motor_topics(sent)
    kind, messages = topics['/motor/voltage']
    topics['/motor/voltage'] = (kind, [messages[0], messages[2700]])
    target = pipeline()
    push(target, topics)
    assert target.join.clock == 'motor/speed'
    record = record_of(target)
    assert len(record) > 2400
    first = sent['voltage'][0], sent['voltage'][2700]
    assert np.array_equal(record['voltage'], np.repeat(first, (2700, len(record) - 2700)))


@pytest.mark.parametrize('estimator', ['rls', 'ekf'])
def test_a_replay_gives_the_same_bits_wherever_its_bag_begins(estimator: str) -> None:
    """Of a sensor that shows its position within one turn, too."""
    record = sampled('steps', 1, ('current', 'speed', 'position'), {}).slice(0, 3000)
    topics = topics_of(record, wrapped=True)
    live, again = pipeline(configuration(estimator)), pipeline(configuration(estimator))
    push(live, topics, START + 700 * MS)
    first = live.stream.first_stamp
    assert first > START + 700 * MS
    again.start_at([first])
    push(again, topics)
    assert again.stream.samples == live.stream.samples > 2000
    assert again.stream.estimate() == live.stream.estimate()


def seen(estimator: str, fresh: NDArray[np.bool_], hidden: bool) -> Mapping[str, Sequence[object]]:
    """Return what an estimator makes of a record; what is not fresh may be hidden from it."""
    record = sampled('steps', 0, (), {}).slice(0, 1500)
    online = OnlineIdentifier(
        configuration(sensor='sampled').model, estimator, record.dt, ['voltage'],
        ['current', 'speed', 'position'],
    )  # fmt: skip
    outputs = np.column_stack([record[name] for name in online.outputs])
    if hidden:
        outputs[~fresh] = np.nan
    online.update(record.time, record['voltage'], outputs, None if hidden else fresh)
    return online.estimate()


def test_a_filter_is_shown_only_what_was_measured_and_a_regression_all() -> None:
    fresh = np.ones((1500, 3), dtype=bool)
    fresh[:, 1:] = (np.arange(1500) % 10 == 0)[:, np.newaxis]
    every = np.ones_like(fresh)
    for filters in ('ekf', 'ukf'):
        assert seen(filters, fresh, False) == seen(filters, fresh, True)
        assert seen(filters, fresh, False) != seen(filters, every, False)
    for regressions in ('rls', 'mras'):
        assert seen(regressions, fresh, False) == seen(regressions, every, False)


@pytest.mark.parametrize('mean', [True, False])
@pytest.mark.parametrize('estimator', ['rls', 'ekf', 'ukf', 'mhe'])
def test_joint_states_at_95_hz_beside_a_drive_at_1_khz_are_enough(
    tmp_path: Path, estimator: str, mean: bool
) -> None:
    """From a start that is off by 30 %; on equal stamps no row was complete.

    The speed is the mean since the message before, or what the drive's own filter says it is.
    """
    record = sampled('steps', 0, ('speed', 'position'), {})
    if not mean:
        true = sampled('steps', 0, (), {})
        speed = np.convolve(np.gradient(true['position'], true.time), np.ones(9) / 9, 'same')
        own = record.samples['speed'].time
        now = Samples(own, np.interp(own, true.time, speed))
        record = replace(record, samples={**record.samples, 'speed': now})
    found = replay(write_bag(tmp_path / 'bag', topics_of(record)), configuration(estimator))
    assert found.dropped == 0
    assert found.samples > 7900
    estimate = found.estimates[-1].estimate
    assert estimate is not None
    for name in ('R', 'k_t', 'J'):
        assert estimate[name][0] == pytest.approx(MOTOR[name], rel=0.01), name


def test_a_robots_own_topics_are_identified_live(
    make_node: 'Callable[..., LoopNode]', other: 'Node', monkeypatch: pytest.MonkeyPatch
) -> None:
    """A drive at 1 kHz, its current 0.3 ms later, joint states at 100 Hz: over real DDS."""
    pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')
    from geometry_msgs.msg import Vector3Stamped
    from ros_harness import wait_for
    from sensor_msgs.msg import JointState

    from motor_sysid.nodes.identifier import IdentifierNode

    record = motor_record(2000)
    topics = motor_topics(record)
    topics['/motor/speed'] = (JOINT, topics['/motor/speed'][1][4::10])
    late = [START + 300_000 + round(t * SECOND) for t in record.time.tolist()]
    amps = [(s, vector(s, x)) for s, x in zip(late, record['current'], strict=True)]
    topics['/motor/current'] = (VECTOR, amps)
    kinds = (Vector3Stamped, Vector3Stamped, JointState)
    publishers = [other.create_publisher(k, t, 5000) for k, t in zip(kinds, TOPICS, strict=True)]
    node = make_node(IdentifierNode, sample_time=0.001)
    told: list[str] = []
    logger = SimpleNamespace(warning=told.append, info=told.append)
    monkeypatch.setattr(node, 'get_logger', lambda: logger)

    def matched() -> bool:
        node.step()
        return len(node._topics) == 3 and all(topic.publishers for topic in node._topics)

    wait_for(matched, 'a match')
    for publisher, topic in zip(publishers, TOPICS, strict=True):
        for _, data in topics[topic][1]:
            publisher.publish(data)
    pipeline = node._pipeline
    wait_for(lambda: (node.step(), pipeline.join.counts.joined >= 1990)[1], 'the samples')
    wait_for(lambda: (node.step(), not node.hurry)[1], 'the rest')
    node._next_look = 0.0
    node.step()
    assert [line for line in told if 'stamps' in line] == [
        'the stamps of the topics differ: samples are taken at those of motor/voltage'
    ]
    window = record_of(pipeline)
    assert window.samples.keys() == {'current', 'speed', 'position'}
    assert window.samples['speed'].values == pytest.approx(record['speed'][4::10])
    assert pipeline.join.counts.dropped == 0
