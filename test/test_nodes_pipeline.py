"""From raw messages to estimates: the parts of the nodes that need no ROS."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
import random

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
import pytest
from rosbags.typesys import get_typestore, Stores

from motor_sysid.errors import UserError
from motor_sysid.estimation.stream import EstimateStream, Event, Rates
from motor_sysid.nodes.hidden import parse_assignments, scales_of_drive, with_hidden
from motor_sysid.nodes.pipeline import Pipeline
from motor_sysid.nodes.sensors import DriveSensors, SensorSettings
from motor_sysid.nodes.times import Times
from motor_sysid.nodes.topics import DEFAULT_SOURCES, plan_signals, with_types
from motor_sysid.physics.model import Model
from motor_sysid.recording.field_reader import FieldReader
from motor_sysid.recording.msg_config import load_msg_config
from motor_sysid.recording.sources import Condition, Source
from motor_sysid.signals.join import StampJoin

Array = NDArray[np.float64]
SECOND = 1_000_000_000
STORE = get_typestore(Stores.ROS2_JAZZY)
STAMP = ('header.stamp.sec', 'header.stamp.nanosec')
JOINT = 'sensor_msgs/msg/JointState'
VECTOR = 'geometry_msgs/msg/Vector3Stamped'


def header(stamp: int, frame: str = '') -> object:
    time = STORE.types['builtin_interfaces/msg/Time'](*divmod(stamp, SECOND))
    return STORE.types['std_msgs/msg/Header'](time, frame)


def joint(stamp: int, names: list[str], position: list[float], velocity: list[float]) -> bytes:
    message = STORE.types[JOINT](
        header(stamp), names, np.array(position), np.array(velocity), np.array([])
    )
    return bytes(STORE.serialize_cdr(message, JOINT))


def vector(stamp: int, x: float, frame: str = 'dc') -> bytes:
    inner = STORE.types['geometry_msgs/msg/Vector3'](x, 0.0, 0.0)
    return bytes(STORE.serialize_cdr(STORE.types[VECTOR](header(stamp, frame), inner), VECTOR))


# --- numbers from CDR


def test_numbers_are_those_that_were_sent_whatever_the_shape() -> None:
    reader = FieldReader(JOINT, (*STAMP, 'velocity[0]', 'position[0]', 'velocity[name=b]'))
    messages = [
        (joint(5_000_000_007, ['a'], [1.5], [2.5]), (5, 7, 2.5, 1.5, None)),
        (joint(6, ['a', 'b'], [1.0, 2.0], [3.0, 4.0]), (0, 6, 3.0, 1.0, 4.0)),
        (joint(6, ['b', 'a'], [1.0, 2.0], [3.0, 4.0]), (0, 6, 3.0, 1.0, 3.0)),
        (joint(6, ['a'], [], [3.0]), (0, 6, 3.0, None, None)),
        (joint(6, ['a'], [3.0], []), (0, 6, None, 3.0, None)),
    ]
    for data, expected in messages * 2:
        found = reader.read(data + b'\xde\xad')  # rclpy may append bytes of no meaning
        assert [None if v != v else v for v in found] == list(expected)


def test_a_message_cut_short_is_refused() -> None:
    reader = FieldReader(VECTOR, (*STAMP, 'vector.x'))
    with pytest.raises(UserError, match='Vector3Stamped'):
        reader.read(vector(1, 1.0)[:26])
    with pytest.raises(UserError, match='not a number'):
        FieldReader(VECTOR, ('header.frame_id',)).read(vector(1, 1.0))


# --- joining


@given(st.lists(st.integers(0, 2), max_size=60), st.sets(st.tuples(
    st.integers(0, 2), st.integers(0, 19)), max_size=12))  # fmt: skip
def test_the_join_depends_on_the_messages_not_on_their_arrival(
    order: list[int], lost: set[tuple[int, int]]
) -> None:
    sent = [[k for k in range(20) if (topic, k) not in lost] for topic in range(3)]
    complete = [k for k in range(20) if all(k in stamps for stamps in sent)]
    join, rows, pointer = StampJoin(3), [], [0, 0, 0]
    for topic in [*order, *([0] * 20), *([1] * 20), *([2] * 20)]:
        if pointer[topic] < len(sent[topic]):
            stamp = sent[topic][pointer[topic]]
            join.push(topic, stamp, (float(10 * topic + stamp),))
            pointer[topic] += 1
            rows += join.pop()
    assert [stamp for stamp, _ in rows] == complete
    assert all(row == (k, (float(k), 10.0 + k, 20.0 + k)) for row, k in zip(rows, complete))  # noqa: B905
    assert join.counts.joined == len(complete)


def test_what_has_no_partner_is_dropped_and_counted() -> None:
    join = StampJoin(2, limit=10)
    join.push(0, -1, ())
    join.push(1, -1, ())
    assert [stamp for stamp, _ in join.pop()] == [-1]
    for stamp in range(15):
        join.push(0, stamp, ())
    assert (join.pop(), join.counts.overflow) == ([], 5)
    join.push(1, 3, ())
    join.push(1, 8, ())
    join.push(1, 8, ())
    assert [stamp for stamp, _ in join.pop()] == [8]
    assert (join.counts.incomplete, join.counts.out_of_order) == (1 + 3, 1)
    assert join.counts.early == 0
    join.push(0, 10 * SECOND, ())
    join.push(0, 3, ())
    assert join.counts.restarts == 1


def test_what_came_before_every_topic_was_heard_is_no_loss() -> None:
    """The third topic is matched 4.7 s late, and then delivers all that it was sent.

    Two topics at 1 kHz then hold no more than the last 4096 messages: 2 * 585 overflow, and the
    third topic's first 585 messages have no partner any more.
    """
    join, rows = StampJoin(3), []
    for stamp in range(4681):
        join.push(0, stamp, ())
        join.push(1, stamp, ())
        rows += join.pop()
    for stamp in range(5000):
        if stamp >= 4681:
            join.push(0, stamp, ())
            join.push(1, stamp, ())
        join.push(2, stamp, ())
        rows += join.pop()
    assert [stamp for stamp, _ in rows] == list(range(585, 5000))
    assert join.counts.early == 3 * 585
    assert join.counts.dropped == 0
    join.push(0, 5001, ())
    join.push(1, 5001, ())
    for stamp in (5000, 5001):
        join.push(2, stamp, ())
    assert [stamp for stamp, _ in join.pop()] == [5001]
    assert join.counts.dropped == join.counts.incomplete == 1


def test_samples_that_were_complete_outlive_a_fall_back() -> None:
    """They do not depend on when one looked."""
    join = StampJoin(2)
    for stamp in (10 * SECOND, 11 * SECOND, 3):
        join.push(0, stamp, ())
        join.push(1, stamp, ())
    assert [stamp for stamp, _ in join.pop()] == [10 * SECOND, 11 * SECOND, 3]
    assert (join.counts.joined, join.counts.incomplete, join.counts.restarts) == (3, 0, 1)


def test_a_tolerance_joins_stamps_that_differ_a_little() -> None:
    join = StampJoin(2, tolerance=10)
    for stamp in (0, 100, 200):
        join.push(0, stamp, (1.0,))
    for stamp in (7, 150, 195):
        join.push(1, stamp, (2.0,))
    assert [stamp for stamp, _ in join.pop()] == [7, 200]


def test_a_tolerance_joins_the_nearest_stamps_after_a_message_was_lost() -> None:
    """A tolerance above the period must not pair each message with the one after its partner."""
    join = StampJoin(2, tolerance=300)
    for k in range(20):
        join.push(0, 200 * k, (float(k),))
        if k != 9:
            join.push(1, 200 * k + 30, (float(k),))
    rows = join.pop()
    assert [values for _, values in rows] == [(k, k) for k in range(20) if k != 9]
    assert join.counts.incomplete == 1


# --- estimates in time


class Sum:
    """An estimator whose every number depends on the order of all that it was given."""

    def __init__(self, dt: float) -> None:
        self.dt, self.value, self.last = dt, 0.0, 0.0

    def update(self, t: Array, inputs: Array, outputs: Array, fresh: Array) -> None:
        for row in zip(t, inputs[:, 0], outputs[:, 0], strict=True):
            self.value = 0.999 * self.value + float(np.sin(row).sum())
            self.last = float(row[2])

    def estimate(self) -> Mapping[str, tuple[float, float, str, bool]]:
        return {'sum': (self.value, 1.0, '1', True)}

    def prediction(self) -> Mapping[str, float]:
        return {'speed': self.value}

    def residual(self) -> Mapping[str, float]:
        return {'speed': self.last - self.value}


RATES = Rates(SECOND // 10, SECOND // 50)


def samples(count: int) -> tuple[NDArray[np.int64], Array, Array]:
    rng = np.random.default_rng(3)
    stamps = 7_123_456_789 + 2_000_000 * np.arange(count)
    return stamps, rng.normal(size=(count, 1)), rng.normal(size=(count, 1))


def fed(sizes: list[int]) -> list[Event]:
    stamps, inputs, outputs = samples(sum(sizes))
    stream, events, start = EstimateStream(Sum, RATES), [], 0
    for size in sizes:
        part = slice(start, start + size)
        events += stream.feed(stamps[part], inputs[part], outputs[part])
        start += size
    return events


def test_events_do_not_depend_on_how_samples_were_bunched() -> None:
    rng = random.Random(1)
    sizes = [rng.randint(1, 40) for _ in range(60)]
    one_by_one, bunched, whole = fed([1] * sum(sizes)), fed(sizes), fed([sum(sizes)])
    assert one_by_one == bunched == whole
    assert sum(event.estimate is not None for event in whole) == sum(sizes) // 50
    assert all(event.digest for event in whole if event.estimate is not None)


def test_the_sample_time_is_learned_and_gaps_are_counted() -> None:
    stamps, inputs, outputs = samples(200)
    keep = np.ones(200, dtype=bool)
    keep[[100, 101, 150]] = False
    stream = EstimateStream(Sum, RATES)
    stream.feed(stamps[keep], inputs[keep], outputs[keep])
    assert stream.sample_time == 0.002
    assert (stream.gaps, stream.missing, stream.samples) == (2, 3, 197)


def test_stamps_that_fall_back_start_the_estimator_anew() -> None:
    stamps, inputs, outputs = samples(300)
    stream = EstimateStream(Sum, RATES)
    first = stream.feed(stamps, inputs, outputs)
    assert stream.feed(stamps, inputs, outputs) == first


# --- the whole


WANTED = ('voltage', 'current', 'speed', 'position')


def pipeline(sources: Sequence[Source] = DEFAULT_SOURCES) -> Pipeline:
    plan = plan_signals(sources, WANTED)
    readers = [topic.reader() for topic in plan.topics]
    stream = EstimateStream(Sum, RATES)
    return Pipeline(plan, readers, stream, ('voltage',), ('current', 'speed'), 100)


def push(target: Pipeline, count: int, start: int = 0) -> None:
    for k in range(count):
        stamp = start + k * 2_000_000
        target.push(0, vector(stamp, 1.0 + k), 0)
        target.push(1, vector(stamp, 2.0), 0)
        target.push(2, joint(stamp, ['m'], [0.1 * k], [3.0]), 0)


def test_the_window_keeps_the_last_samples_as_a_record() -> None:
    target = pipeline()
    push(target, 150)
    target.advance()
    record = target.record()
    assert record is not None
    assert (len(record), record.dt) == (100, pytest.approx(0.002))
    assert record['voltage'].tolist() == [1.0 + k for k in range(50, 150)]
    assert record.units['position'] == 'rad'
    short = target.record(0.1)
    assert short is not None
    assert len(short) == 50


def test_the_window_begins_anew_where_the_stamps_fall_back() -> None:
    target = pipeline()
    for start, count in ((500 * SECOND, 80), (20 * SECOND, 30)):
        push(target, count, start)
        target.advance()
        record = target.record()
        assert record is not None
        assert record['voltage'].tolist() == [1.0 + k for k in range(count)]
    push(target, 150, SECOND)  # more than it holds, and falls back within one batch
    push(target, 40, 0)
    target.advance()
    assert target.window.last()[0].tolist() == [k * 2_000_000 for k in range(40)]


def test_units_and_signs_are_those_of_the_msg_config() -> None:
    changed = [
        replace(s, unit='rpm', sign=-1) if s.signal == 'speed' else s for s in DEFAULT_SOURCES
    ]
    target = pipeline(changed)
    push(target, 3)
    target.advance()
    record = target.record()
    assert record is not None
    assert record['speed'][0] == pytest.approx(-3.0 * 2 * np.pi / 60)


def test_samples_with_a_value_that_is_no_number_are_left_out_and_counted() -> None:
    target = pipeline()
    for stamp in range(3):
        target.push(0, vector(stamp, float('nan') if stamp else 0.0), 0)
        target.push(1, vector(stamp, 1.0), 0)
        target.push(2, joint(stamp, ['m'], [], [1.0]), 0)
    target.advance()
    assert target.not_finite == 2
    assert target.record() is None


def test_a_slow_estimator_works_off_its_backlog_in_small_pieces() -> None:
    at_once, bit_by_bit = pipeline(), pipeline()
    for target in (at_once, bit_by_bit):
        push(target, 400)
    expected, found = at_once.advance(), []
    calls = 0
    while bit_by_bit.collect():
        found += bit_by_bit.advance(budget=1e-4)
        calls += 1
    assert found == expected
    assert calls > 3
    assert bit_by_bit.overrun == 0


def test_a_hopeless_backlog_is_cut_at_its_old_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('motor_sysid.nodes.pipeline.LONGEST_BACKLOG', 100)
    target = pipeline()
    push(target, 150)
    assert target.collect() == 100
    assert target.overrun == 50
    target.advance()
    record = target.record()
    assert record is not None
    assert record['voltage'][0] == 51.0


def test_percentiles_of_times_are_right_to_five_percent() -> None:
    times = Times()
    for k in range(1, 1001):
        times.add(k * 1e-5)
    assert times.percentile(0.5) == pytest.approx(5e-3, rel=0.06)
    assert times.percentile(0.99) == pytest.approx(9.9e-3, rel=0.06)
    assert times.percentile(1.0) == times.longest == 0.01


def test_a_signal_without_a_topic_is_named() -> None:
    with pytest.raises(UserError, match='torque'):
        plan_signals(DEFAULT_SOURCES, ('torque',))
    sources = [Source('speed', topic='odom', field='x')]
    assert plan_signals(sources, ('speed',)).untyped == {'odom'}
    typed = plan_signals(with_types(sources, {'odom': JOINT}), ('speed',))
    assert (typed.signals, typed.untyped) == (('speed',), set())


SUPPLY = (
    Source('voltage', product=('duty', 'supply_voltage')),
    Source('duty', topic='drive', field='x'),
    Source('supply_voltage', topic='battery', field='x', optional=True),
    Source('supply_voltage', topic='charger', field='x'),
    Source('supply_voltage', constant=24.0),
    Source('speed', topic='joints', field='x'),
    Source('speed', topic='odom', field='x'),
    Source('position', topic='encoder', field='x', optional=True),
)


@pytest.mark.parametrize(
    ('there', 'topics', 'constant'),
    [
        (None, ('drive', 'battery', 'joints', 'encoder'), False),
        ((), ('drive', 'joints'), True),
        (('odom',), ('drive', 'odom'), True),
        (('charger', 'odom', 'encoder'), ('drive', 'charger', 'odom', 'encoder'), False),
    ],
)
def test_the_first_source_that_is_there_is_taken(
    there: tuple[str, ...] | None, topics: tuple[str, ...], constant: bool
) -> None:
    wanted = ('voltage', 'speed', 'position')
    plan = plan_signals(SUPPLY, wanted, there=there, spare=wanted[1:])
    assert plan.names == topics
    assert any(source.constant for source in plan.computed) == constant


def test_an_optional_signal_stays_where_its_topic_is_wanted_for_another() -> None:
    """In the default file the position, which comes with the speed."""
    wanted = ('position', 'voltage', 'current', 'speed')
    plan = plan_signals(DEFAULT_SOURCES, wanted, there=(), spare=wanted)
    assert set(plan.signals) == set(wanted)


def test_a_type_that_is_given_once_holds_for_the_topic() -> None:
    speed, position = DEFAULT_SOURCES[2:4]
    typed = with_types([speed, replace(position, type='')], {'motor/speed': 'other'})
    assert [source.type for source in typed] == [JOINT, JOINT]


def test_a_signal_may_be_computed_from_others() -> None:
    sources = [
        Source('voltage', column='voltage [V]'),
        Source('voltage', product=('duty', '_supply')),
        Source('duty', topic='motor/voltage', type=VECTOR, field='vector.x', unit='%'),
        Source('_supply', constant=24.0, unit='V'),
        *DEFAULT_SOURCES[1:],
    ]
    target = pipeline(sources)
    push(target, 3)
    target.advance()
    record = target.record()
    assert record is not None
    assert record['voltage'].tolist() == [0.24, 0.48, 0.72]
    assert '_supply' not in record


def test_a_source_with_a_condition_is_taken_if_no_text_meets_it() -> None:
    linear, rotary = (
        Source('speed', topic='a', type=JOINT, field='velocity[0]', unit='m/s',
               when=Condition('header.frame_id', allowed=frozenset({'linear'}))),
        Source('speed', topic='b', type=JOINT, field='velocity[0]',
               when=Condition('header.frame_id', refused=frozenset({'abc'}))),
    )  # fmt: skip
    assert plan_signals([linear, rotary], ('speed',)).sources == (rotary,)


@pytest.mark.parametrize('name', ['default', 'ros2_control'])
def test_shipped_msg_configs_can_be_read_live(name: str) -> None:
    sources = load_msg_config(name).all_sources()
    topics = plan_signals(sources, WANTED).untyped
    assert topics
    typed = with_types(sources, dict.fromkeys(topics, JOINT))
    assert not plan_signals(typed, WANTED).untyped


# --- the simulated drive


def test_the_encoder_counts_and_its_speed_is_the_difference() -> None:
    sensors = DriveSensors(SensorSettings(1000, 0.0, 0.5, 2.0, 12), 0.001)
    step = 2 * np.pi / 1000
    shown = {'speed': 1.0, 'position': 3.4 * step}
    speed, position = sensors.motion(shown, {'omega': 1.0})
    current = sensors.current(0.25)
    assert position == pytest.approx(3 * step)
    assert speed == pytest.approx(3 * step / 0.001)
    assert current == pytest.approx(0.75, abs=2.0 / 2**12)
    assert sensors.motion(shown, {'omega': 0.5})[0] == pytest.approx(0.5)
    assert sensors.current(99.0) == pytest.approx(2.0, rel=1e-3)
    again = [DriveSensors(SensorSettings(seed=5), 0.001).current(0.1) for _ in range(2)]
    assert again[0] == again[1]


def test_hidden_effects_get_a_size_or_the_given_one() -> None:
    base = Model.base('brushed_dc', {'R': 2.0, 'k_t': 0.05})
    scales = scales_of_drive(base, 24.0, 0.002)
    given_value = parse_assignments(('coulomb_friction.tau_c = 0.01',))
    plant = with_hidden(base, ('coulomb_friction', 'cogging_torque'), given_value, scales)
    assert plant['coulomb_friction.tau_c'] == 0.01
    assert plant['cogging_torque.a_1'] > 0.001
    with pytest.raises(UserError, match=r'effect\.parameter=number'):
        parse_assignments(('coulomb_friction',))
    with pytest.raises(UserError, match='unknown effect'):
        with_hidden(base, ('witchcraft',), {}, scales)
    with pytest.raises(UserError, match='`coulomb_friction` is not hidden; hide it, too'):
        with_hidden(base, ('cogging_torque',), given_value, scales)
