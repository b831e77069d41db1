"""Bags: whole, damaged, with custom types, out of order; and what is said about each."""

from collections.abc import Callable, Mapping
import contextlib
from dataclasses import replace
from pathlib import Path
import shutil
import struct

import numpy as np
import pytest
from recording_tools import (
    custom,
    joints,
    motor_record,
    motor_topics,
    MS,
    START,
    Topic,
    types,
    vector,
    write_bag,
    write_rows,
)
from rosbags.interfaces import Connection
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
import yaml

from motor_sysid.errors import UserError
from motor_sysid.recording import load, Loaded
from motor_sysid.recording.msg_config import load_msg_config
from motor_sysid.recording.rosbag import Bag, ZSTD
from motor_sysid.recording.save import write_record
from motor_sysid.signals import Record

VECTOR = 'geometry_msgs/msg/Vector3Stamped'
JOINTS = 'sensor_msgs/msg/JointState'
Row = tuple[int, str, bytes]


def codes(loaded: Loaded) -> set[str]:
    return {finding.code for finding in loaded.findings}


def same(one: Record, other: Record) -> bool:
    begin = one.time - one.time[0], other.time - other.time[0]
    return len(one) == len(other) and np.allclose(*begin, rtol=0, atol=1e-9) and all(
        np.array_equal(one[name], other[name]) for name in one
    )


def storage_file(bag: Path) -> Path:
    return next(file for file in bag.iterdir() if file.suffix in {'.db3', '.mcap'})


def with_rosbags(
    path: Path, topics: Mapping[str, Topic], storage: StoragePlugin,
    mode: CompressionMode = CompressionMode.NONE,
) -> Path:  # fmt: skip
    """Write a bag as recorders do: a topic gets its place with its first message."""
    rows = [(at, name, data) for name, (_, rest) in topics.items() for at, data in rest]
    known: dict[str, Connection] = {}
    writer = Writer(path, version=9, storage_plugin=storage)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        for received, name, data in sorted(rows):
            if name not in known:
                known[name] = writer.add_connection(name, topics[name][0], typestore=types())
            writer.write(known[name], received, data)
    return path


@pytest.fixture(scope='module', params=['sqlite3', 'mcap', 'mcap_zstd'])
def bag(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a bag of 40 000 messages: several chunks, many pages."""
    storage, _, zstd = request.param.partition('_')
    path = tmp_path_factory.mktemp('bags') / request.param
    write_record(motor_record(13_334), path, storage=storage, compress=bool(zstd))
    return path


@pytest.mark.parametrize('storage', ['sqlite3', 'mcap'])
def test_golden_bag(repository: Path, storage: str) -> None:
    expected = yaml.safe_load((repository / 'bags' / 'golden.yaml').read_text())
    loaded = load(repository / 'bags' / f'golden_{storage}')
    (record,) = loaded.records
    assert record.digest() == expected['sha256']
    assert (len(record), list(record)) == (expected['samples'], expected['signals'])
    assert record.dt == pytest.approx(expected['dt_s'])
    assert {name: record[name][-1] for name in record} == expected['last_row']
    assert loaded.findings == ()


def test_round_trip_of_folder_and_file(bag: Path) -> None:
    record = motor_record(13_334)
    for path in (bag, storage_file(bag)):
        loaded = load(path)
        assert same(loaded.records[0], record)
        assert not codes(loaded)


def test_bag_equals_csv_of_the_same_motor(data_dir: Path) -> None:
    cases = data_dir / 'hidden_effect_cases'
    for name in ('motor_b/valid', 'motor_d/train_1', 'motor_f/valid'):
        bag, table = load(cases / f'{name}_bag'), load(cases / f'{name}.csv.gz')
        assert set(table.records[0]) - set(bag.records[0]) <= {'hall_sector'}
        assert same(bag.records[0], table.records[0])
        assert codes(bag) <= {'out_of_order'}


@pytest.mark.parametrize('share', [0.05, 0.5, 0.999])
def test_truncated_bag_gives_what_is_left(bag: Path, tmp_path: Path, share: float) -> None:
    file = storage_file(bag)
    broken = tmp_path / file.name
    data = file.read_bytes()
    broken.write_bytes(data[: int(share * len(data))])
    if share < 0.1 and 'zstd' in bag.name:  # within the first chunk
        with pytest.raises(UserError, match='no topics'):
            load(broken)
        return
    loaded = load(broken)
    record = loaded.records[0]
    whole, rows = motor_record(13_334), np.round(record.time * 1000).astype(int)
    for name in record:  # beside a hole, a value or two is interpolated
        assert np.mean(record[name] == whole[name][rows]) > 0.99
    assert len(record) == 13_334 or 'damaged_bag' in codes(loaded)
    if 'zstd' not in bag.name:
        assert len(record) > 0.8 * share * 13_334


def test_any_truncation_or_flipped_bytes_end_well(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    for storage in ('sqlite3', 'mcap'):
        bag = tmp_path / storage
        write_record(motor_record(60), bag, storage=storage)
        file = storage_file(bag)
        data = file.read_bytes()
        for _ in range(25):
            spoilt = bytearray(data[: rng.integers(0, len(data))])
            for k in rng.integers(0, max(len(spoilt), 1), 3 * rng.integers(0, 2)):
                spoilt[k : k + 1] = bytes([rng.integers(0, 256)])
            broken = tmp_path / f'broken{file.suffix}'
            broken.write_bytes(bytes(spoilt))
            with contextlib.suppress(UserError):
                load(broken)


def test_corrupt_chunk_is_left_out(tmp_path: Path) -> None:
    write_record(motor_record(13_334), tmp_path / 'bag', storage='mcap', compress=True)
    file = storage_file(tmp_path / 'bag')
    first, second, rest = file.read_bytes().split(b'\x28\xb5\x2f\xfd', 2)  # begin of a zstd frame
    file.write_bytes(first + b'\x28\xb5\x2f\xfd' + second + b'none' + rest)
    loaded = load(tmp_path / 'bag')
    assert 'damaged_bag' in codes(loaded)
    assert sum(map(len, loaded.records)) > 3000


def chunk_starts(data: bytes) -> list[int]:
    """Return where the chunks of an MCAP file begin, as its summary says."""
    (position,) = struct.unpack_from('<Q', data, len(data) - 28)
    found = []
    while position < len(data) - 37:
        opcode, length = struct.unpack_from('<BQ', data, position)
        if opcode == 8:
            found += struct.unpack_from('<Q', data, position + 25)
        position += 9 + length
    return found


@pytest.mark.parametrize('compress', [False, True])
def test_what_is_overwritten_costs_no_chunk_behind_it(tmp_path: Path, compress: bool) -> None:
    record = motor_record(30_000)
    write_record(record, tmp_path / 'bag', storage='mcap', compress=compress)
    file = storage_file(tmp_path / 'bag')
    data = bytearray(file.read_bytes())
    _, second, third, *_ = chunk_starts(data)
    data[second - 60 : third - 200] = bytes(third - second - 140)  # index of the first, to that
    file.write_bytes(data)
    loaded = load(tmp_path / 'bag')
    (damage,) = (f for f in loaded.findings if f.code == 'damaged_bag')
    assert 'nothing can be read of bytes' in damage.message
    assert damage.remedy.startswith('copy the bag again')
    first, last = loaded.records
    rows = third / len(data) - second / len(data)
    assert len(first) + len(last) == pytest.approx((1 - rows) * len(record), rel=0.05)
    assert last.time[-1] - last.time[0] == pytest.approx(1e-3 * (len(last) - 1))
    assert np.array_equal(last['voltage'], record['voltage'][-len(last) :])


def test_channels_that_come_late_in_a_broken_file_are_found(tmp_path: Path) -> None:
    """`ros2 bag record` writes a channel just before its first message."""
    topics = motor_topics(motor_record(400))
    path = with_rosbags(tmp_path / 'bag', topics, StoragePlugin.MCAP)
    data = storage_file(path).read_bytes()
    broken = tmp_path / 'broken.mcap'
    broken.write_bytes(data[: int(0.9 * len(data))])
    assert set(load(broken).records[0]) == {'voltage', 'current', 'speed', 'position'}


@pytest.mark.parametrize('storage', [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize('mode', [CompressionMode.MESSAGE, CompressionMode.FILE])
def test_compression_is_seen_without_metadata(
    tmp_path: Path, storage: StoragePlugin, mode: CompressionMode
) -> None:
    record = motor_record(300)
    path = with_rosbags(tmp_path / 'bag', motor_topics(record), storage, mode)
    (path / 'metadata.yaml').unlink()
    (file,) = path.iterdir()
    assert same(load(path).records[0], record)
    assert same(load(file).records[0], record)


def test_a_compressed_message_that_is_damaged_costs_no_other(tmp_path: Path) -> None:
    record = motor_record(300)
    path = with_rosbags(
        tmp_path / 'bag', motor_topics(record), StoragePlugin.MCAP, CompressionMode.MESSAGE
    )
    file = storage_file(path)
    frames = file.read_bytes().split(ZSTD)
    frames[400] = frames[400][:2] + bytes(10) + frames[400][12:]
    file.write_bytes(ZSTD.join(frames))
    loaded = load(path)
    assert sum(map(len, loaded.records)) >= 298
    assert 'damaged_bag' in codes(loaded)


def test_a_bag_that_lost_all_of_its_chunks_is_not_called_empty(
    repository: Path, tmp_path: Path
) -> None:
    data = bytearray((repository / 'bags' / 'golden_mcap' / 'golden_mcap.mcap').read_bytes())
    file = tmp_path / 'golden.mcap'
    (start,) = chunk_starts(data)
    data[start + 500 : start + 8500] = bytes(8000)
    file.write_bytes(data)
    with pytest.raises(UserError, match=r'damaged: one chunk .*; copy it again'):
        load(file)
    file.write_bytes(data[:40])
    with pytest.raises(UserError, match=r'no topics .* breaks off at byte 40 .*; copy it again'):
        load(file)


def test_folder_without_metadata(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = tmp_path / 'copy'
    shutil.copytree(bag, copy)
    (copy / 'metadata.yaml').unlink()
    loaded = load(copy)
    assert len(loaded.records[0]) == 13_334
    assert codes(loaded) == {'missing_metadata'}
    (copy / 'metadata.yaml').write_text('{nonsense: [')
    assert codes(load(copy)) == {'missing_metadata'}
    monkeypatch.chdir(copy)
    assert any('of copy cannot be read' in one.message for one in load('.').findings)


def test_split_bag_with_one_file_gone(tmp_path: Path) -> None:
    record = motor_record(400)
    for k in range(3):
        part = record.slice(100 * k, 100 * (k + 1))
        write_record(part, tmp_path / f'part{k}')
        tmp_path.joinpath('bag').mkdir(exist_ok=True)
        shutil.copy(storage_file(tmp_path / f'part{k}'), tmp_path / 'bag' / f'bag_{k}.db3')
    assert same(load(tmp_path / 'bag').records[0], record.slice(0, 300))
    information = {'relative_file_paths': ['bag_0.db3', 'bag_1.db3', 'bag_2.db3', 'bag_3.db3']}
    (tmp_path / 'bag' / 'metadata.yaml').write_text(
        yaml.safe_dump({'rosbag2_bagfile_information': information})
    )
    loaded = load(tmp_path / 'bag')
    assert len(loaded.records[0]) == 300
    assert any('bag_3.db3' in finding.message for finding in loaded.findings)


def test_a_file_that_cannot_be_read_costs_no_other(tmp_path: Path) -> None:
    bag = tmp_path / 'bag'
    write_record(motor_record(100), bag, storage='mcap')
    (bag / 'metadata.yaml').unlink()
    (bag / 'more.mcap').mkdir()
    loaded = load(bag)
    assert len(loaded.records[0]) == 100
    assert 'damaged_bag' in codes(loaded)
    with pytest.raises(UserError, match='does not exist; a bag is a folder'):
        Bag(tmp_path / 'none.mcap')


@pytest.mark.parametrize(
    ('name', 'content', 'message'),
    [
        ('a.mcap', b'', 'is empty'),
        ('a.db3', b'', 'is empty'),
        ('a.mcap', b'something else', 'not an MCAP file'),
        ('a.db3', b'something else', 'not a sqlite3 database'),
        ('a.mcap', b'\x89MCAP0\r\n', 'no topics'),
    ],
)
def test_what_is_no_bag(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UserError, match=message):
        load(tmp_path / name)


def test_empty_bags(tmp_path: Path) -> None:
    with pytest.raises(UserError, match='does not exist'):
        load(tmp_path / 'nothing')
    with pytest.raises(UserError, match='no bag'):
        load(tmp_path)
    with pytest.raises(UserError, match='no topics'):
        load(write_bag(tmp_path / 'empty', {}))
    silent = write_bag(tmp_path / 'silent', {'/motor/speed': (JOINTS, [])})
    with pytest.raises(UserError, match='no messages on /motor/speed'):
        load(silent)
    one = write_bag(tmp_path / 'one', {'/motor/voltage': (VECTOR, [(START, vector(START, 1.0))])})
    with pytest.raises(UserError, match='no two complete samples'):
        load(one)


def test_unknown_topics_show_the_yaml(tmp_path: Path) -> None:
    messages = [(START + k * MS, joints(START + k * MS, ['a'], [0], [k])) for k in range(30)]
    path = write_bag(tmp_path / 'bag', {'/arm/joint_states': (JOINTS, messages)})
    with pytest.raises(UserError, match='velocity') as error:
        load(path)
    text = str(error.value)
    assert '/arm/joint_states  (sensor_msgs/msg/JointState)' in text
    snippet = text[text.index('  signals:') :]
    config = tmp_path / 'mine.yaml'
    config.write_text(snippet)
    assert load(path, config).records[0]['speed'][5] == 5


def test_namespaces(tmp_path: Path) -> None:
    left, right = motor_record(50), motor_record(50, seed=1)
    topics = {f'/left{name}': topic for name, topic in motor_topics(left).items()}
    alone = write_bag(tmp_path / 'alone', topics)
    assert same(load(alone).records[0], left)
    topics |= {f'/right{name}': topic for name, topic in motor_topics(right).items()}
    both = write_bag(tmp_path / 'both', topics)
    with pytest.raises(UserError, match='namespace: /left'):
        load(both)
    assert same(load(both, namespace='/right').records[0], right)


def test_custom_type_through_the_definition_in_the_bag(tmp_path: Path) -> None:
    """Strings of changing length, nested arrays, and lookup by name, next to rosbags' decoder."""
    names = ['knee', 'hip']
    rows = []
    for k in range(40):
        order = names if k % 3 else names[::-1]
        values = {name: k + (0.5 if name == 'hip' else 0.0) for name in order}
        rows.append((START + k * MS, custom(START + k * MS, 'x' * (k % 5), values)))
    config = tmp_path / 'mine.yaml'
    field = 'joints[1].values[names=hip]'
    config.write_text(
        f"signals:\n  speed: {{topic: /state, field: '{field}', unit: rpm, stamp: when}}\n"
        "  position: {topic: /state, field: 'joints[1].fixed[2]', stamp: when}\n"
    )
    for storage in ('sqlite3', 'mcap'):
        bag = write_bag(tmp_path / storage, {'/state': ('demo_msgs/msg/State', rows)}, storage)
        record = load(bag, config).records[0]
        assert record['speed'] == pytest.approx((np.arange(40) + 0.5) * np.pi / 30)
        assert set(record['position']) == {2.0}


def test_one_of_several_joints(tmp_path: Path) -> None:
    rows = []
    for k in range(60):
        names, values = (['a', 'b'], [k, k + 100]) if k % 2 else (['b', 'a'], [k + 100, k])
        rows.append((START + k * MS, joints(START + k * MS, names, [0, 0], values)))
    bag = write_bag(tmp_path / 'bag', {'/motor/speed': (JOINTS, rows)})
    assert 'several_joints' in codes(load(bag))
    config = tmp_path / 'mine.yaml'
    config.write_text("signals: {speed: {topic: motor/speed, field: 'velocity[name=b]'}}")
    assert load(bag, config).records[0]['speed'].tolist() == list(range(100, 160))


def test_a_joint_that_is_not_there_is_said_with_those_that_are(tmp_path: Path) -> None:
    rows = [(START + k * MS, joints(START + k * MS, ['hip', 'elbow'], [0, 0], [k, k]))
            for k in range(30)]  # fmt: skip
    bag = write_bag(tmp_path / 'bag', {'/joint_states': (JOINTS, rows)})
    config = tmp_path / 'mine.yaml'
    config.write_text("signals: {speed: {topic: joint_states, field: 'velocity[name=knee]'}}")
    with pytest.raises(UserError, match=r'no message .* `velocity\[name=knee\]`; they list hip'):
        load(bag, config)


@pytest.mark.parametrize('lists', [(['a'], ['b']), (['a', 'b'], ['b', 'a'])])
def test_joints_that_take_turns_are_not_mixed(
    tmp_path: Path, lists: tuple[list[str], ...]
) -> None:
    """Two publishers on one topic, or one that changes the order."""
    rows = []
    for k in range(60):
        names = lists[k % 2]
        values = [k + 1000 * (name == 'b') for name in names]
        rows.append((START + k * MS, joints(START + k * MS, names, [0] * len(names), values)))
    loaded = load(write_bag(tmp_path / 'bag', {'/motor/speed': (JOINTS, rows)}))
    assert max(loaded.records[0]['speed']) < 1000
    told = [f.message for f in loaded.findings if f.code == 'several_joints']
    assert told
    assert all('30 of 60 messages' in message for message in told)


def test_overtaking_messages_are_sorted(tmp_path: Path) -> None:
    record = motor_record(300)
    rng = np.random.default_rng(0)
    delays = rng.exponential(0.4 * MS, 300).astype(int)
    bag = write_bag(tmp_path / 'bag', motor_topics(record, lambda k: int(delays[k])))
    loaded = load(bag)
    assert same(loaded.records[0], record)
    assert codes(loaded) == {'out_of_order'}


def test_clock_that_starts_anew_gives_two_records(tmp_path: Path) -> None:
    record = motor_record(100)
    topics = motor_topics(record)
    for name, (kind, messages) in topics.items():
        again = [(received + 200 * MS, data) for received, data in messages]
        topics[name] = (kind, [*messages, *again])
    loaded = load(write_bag(tmp_path / 'bag', topics))
    assert [len(part) for part in loaded.records] == [100, 100]
    assert all(same(part, record) for part in loaded.records)
    assert 'time_jumps_back' in codes(loaded)


KINDS = {'/motor/voltage': VECTOR, '/motor/speed': JOINTS}


def drive(count: int, received: Callable[[int], int], stamp: Callable[[int], int]) -> list[Row]:
    """Return messages as they were stored, one of each kind for each sample k."""
    rows = []
    for k in range(count):
        angle, speed = 0.01 * k, float(np.cos(k / 50))
        rows.append((received(k), '/motor/speed', joints(stamp(k), ['a'], [angle], [speed])))
        rows.append((received(k) + 1000, '/motor/voltage', vector(stamp(k), np.sin(k / 50))))
    return rows


@pytest.mark.parametrize('storage', ['sqlite3', 'mcap'])
@pytest.mark.parametrize('back', [500 * MS, 500 * MS + 400_000, 3600_000 * MS])
def test_a_clock_that_is_set_back_shuffles_nothing(
    tmp_path: Path, storage: str, back: int
) -> None:
    """Of the recorder alone it costs nothing; of what stamps the messages, too, a new record."""
    def wrong(k: int) -> int:
        return START + k * MS - back * (k >= 1000)

    def right(k: int) -> int:
        return START + k * MS

    alone = load(write_rows(tmp_path / 'alone', KINDS, drive(2000, wrong, right), storage))
    (record,) = alone.records
    assert np.diff(record['position']) == pytest.approx(0.01)
    assert codes(alone) == {'clock_set_back'}

    both = load(write_rows(tmp_path / 'both', KINDS, drive(2000, wrong, wrong), storage))
    assert [len(one) for one in both.records] == [1000, 1000]
    for one, begin in zip(both.records, (0.0, 10.0), strict=True):
        assert one['position'] == pytest.approx(begin + 0.01 * np.arange(1000))
    assert {'clock_set_back', 'time_jumps_back'} == codes(both)


@pytest.mark.parametrize('stamp', ['header', 'receive'])
@pytest.mark.parametrize('phase', [0, 300_000])
def test_a_simulation_that_starts_anew_begins_a_new_record(
    tmp_path: Path, phase: int, stamp: str
) -> None:
    """Its time was recorded as that of reception, so both runs have the same times."""
    def clock(k: int) -> int:
        return 1000 * MS + (k % 300) * MS + phase * (k >= 300)

    rows = drive(600, clock, clock)
    late = [(clock(k), '/motor/reference', vector(clock(k), k)) for k in (450, 500)]
    rows = rows[:900] + late[:1] + rows[900:1000] + late[1:] + rows[1000:]
    config = tmp_path / 'mine.yaml'
    config.write_text(
        f"stamp: {stamp}\nsignals:\n  position: {{topic: motor/speed, field: 'position[0]'}}\n"
        '  voltage: {topic: motor/voltage, field: vector.x}\n'
        '  speed_reference: {topic: motor/reference, field: vector.x}\n'
    )
    bag = write_rows(tmp_path / 'bag', {**KINDS, '/motor/reference': VECTOR}, rows, 'mcap')
    first, second = load(bag, config).records
    assert first['position'] == pytest.approx(0.01 * np.arange(len(first)), abs=0.011)
    assert set(second['speed_reference']) == {450.0, 500.0}
    assert 'speed_reference' not in first
    assert len(first) >= 299
    received = [row[1] for row in Bag(bag).iterate()]
    assert received == sorted(received)


def test_what_threads_of_a_recorder_swapped_is_no_clock_set_back(tmp_path: Path) -> None:
    rows = drive(1000, lambda k: START + k * MS, lambda k: START + k * MS)
    rng = np.random.default_rng(0)
    order = np.argsort(np.arange(len(rows)) + rng.uniform(0, 12, len(rows)))
    swapped = load(write_rows(tmp_path / 'swapped', KINDS, [rows[k] for k in order], 'mcap'))
    by_topic = sorted(rows, key=lambda row: row[1])
    apart = load(write_rows(tmp_path / 'apart', KINDS, by_topic, 'mcap'))
    for loaded in (swapped, apart):
        assert [len(one) for one in loaded.records] == [1000]
        assert not codes(loaded)


def test_a_damaged_file_keeps_the_order_of_storage(tmp_path: Path) -> None:
    def clock(k: int) -> int:
        return START + k * MS - 500 * MS * (k >= 1000)

    file = storage_file(write_rows(tmp_path / 'bag', KINDS, drive(3000, clock, clock)))
    broken = tmp_path / 'broken.db3'
    broken.write_bytes(file.read_bytes()[:-70_000])
    loaded = load(broken)
    first, second = loaded.records
    assert {'damaged_bag', 'clock_set_back'} <= codes(loaded)
    assert (len(first), len(second) > 1000) == (1000, True)
    assert np.diff(second['position']) == pytest.approx(10 * np.diff(second.time), rel=1e-4)


def test_lost_messages_make_a_gap(tmp_path: Path) -> None:
    topics = motor_topics(motor_record(300))
    kind, messages = topics['/motor/current']
    topics['/motor/current'] = (kind, messages[:100] + messages[150:])
    loaded = load(write_bag(tmp_path / 'bag', topics))
    assert [len(part) for part in loaded.records] == [100, 150]
    assert codes(loaded) >= {'gap', 'topics_overlap'}


@pytest.mark.parametrize('idle', [True, False])
def test_a_reference_that_starts_late_counts_if_the_motor_idled_before(
    tmp_path: Path, idle: bool
) -> None:
    """A controller is often started after the motor; what it drove is the record then."""
    record = motor_record(300)
    if idle:
        voltage = np.where(np.arange(300) < 200, 0.0, record['voltage'])
        record = Record(record.time, {**record.signals, 'voltage': voltage}, record.units)
    topics = motor_topics(record)
    kind, messages = topics['/motor/voltage']
    topics['/motor/reference'] = (kind, messages[200:])
    loaded = load(write_bag(tmp_path / 'bag', topics))
    (one,) = loaded.records
    assert len(one) == (100 if idle else 300)
    assert ('speed_reference' in one) == idle
    assert ('reference_left_out' in codes(loaded)) != idle


def test_repeated_and_zero_stamps(tmp_path: Path) -> None:
    topics = motor_topics(motor_record(50))
    kind, messages = topics['/motor/speed']
    topics['/motor/speed'] = (kind, sorted([*messages, messages[7]], key=lambda m: m[0]))
    loaded = load(write_bag(tmp_path / 'bag', topics))
    assert len(loaded.records[0]) == 50
    assert 'repeated_stamps' in codes(loaded)
    zero = [(START + k * MS, vector(0, k)) for k in range(20)]
    with pytest.raises(UserError, match=r'all zero.*stamp: receive'):
        load(write_bag(tmp_path / 'zero', {'/motor/voltage': (VECTOR, zero)}))


def test_topics_with_other_stamps_are_joined(tmp_path: Path) -> None:
    """Voltage 0.3 ms later than speed and current: their own samples are kept."""
    record = motor_record(200)
    loaded = load(write_bag(tmp_path / 'bag', motor_topics(record, lag=300_000)))
    (joined,) = loaded.records
    assert 'topics_joined' in codes(loaded)
    count = len(joined) - 1
    assert np.array_equal(joined['voltage'], record['voltage'][: len(joined)])
    between = 0.7 * record['speed'][:count] + 0.3 * record['speed'][1 : count + 1]
    assert joined['speed'][:count] == pytest.approx(between)
    own = joined.samples['speed']
    assert np.array_equal(own.values[: count + 1], record['speed'][: count + 1])
    assert own.time[: count + 1] == pytest.approx(record.time[: count + 1] - 3e-4)


def test_an_input_with_other_stamps_than_the_chosen_clock_is_averaged(tmp_path: Path) -> None:
    record = motor_record(200)
    path = write_bag(tmp_path / 'bag', motor_topics(record, lag=300_000))
    config = replace(load_msg_config('default'), base_clock='speed')
    (joined,) = load(path, config).records
    assert not joined.samples.keys() & {'speed', 'position'}
    k = round(joined.time[0] / record.dt) or 1
    expected = 0.3 * record['voltage'][k - 1 :] + 0.7 * np.append(record['voltage'][k:], 0)
    count = min(len(joined), expected.size) - 3
    assert joined['voltage'][:count] == pytest.approx(expected[:count], abs=1e-6)
    assert np.array_equal(joined['speed'][:count], record['speed'][k : k + count])


def test_slow_topic_is_interpolated_and_rare_one_held(tmp_path: Path) -> None:
    record = motor_record(200)
    topics = motor_topics(record)
    kind, messages = topics['/motor/current']
    topics['/motor/current'] = (kind, messages[::5])
    steps = [(START + k * MS, vector(START + k * MS, k)) for k in (0, 40, 150)]
    topics['/motor/reference'] = (VECTOR, steps)
    (joined,) = load(write_bag(tmp_path / 'bag', topics)).records
    assert joined['current'][::5].tolist() == record['current'][: len(joined) : 5].tolist()
    before, after = joined['current'][[0, 5]]
    assert joined['current'][1] == pytest.approx(0.8 * before + 0.2 * after)
    assert set(joined['speed_reference']) == {0.0, 40.0, 150.0}


def test_clocks_that_differ_are_noticed(tmp_path: Path) -> None:
    record = motor_record(400)
    skewed = load(write_bag(tmp_path / 'a', motor_topics(record, lag=-20 * MS)))
    assert 'clock_skew' in codes(skewed)
    topics = motor_topics(record)
    stamps = [START + 3_600_000 * MS + k * MS for k in range(50)]
    topics['/motor/voltage'] = (VECTOR, [(stamp, vector(stamp, 0)) for stamp in stamps])
    with pytest.raises(UserError, match='no time in common'):
        load(write_bag(tmp_path / 'b', topics))


def test_a_machine_that_cannot_keep_up_has_no_clocks_that_differ(tmp_path: Path) -> None:
    """Messages wait for 0 to 80 ms before they are recorded, those of one topic for 10 ms more."""
    record = motor_record(2000)
    topics = motor_topics(record, delay=lambda k: (k % 81) * MS)
    kind, messages = topics['/motor/voltage']
    topics['/motor/voltage'] = (kind, [(when + 10 * MS, data) for when, data in messages])
    assert not {'clock_skew', 'clock_drift'} & codes(load(write_bag(tmp_path / 'bag', topics)))
    topics['/motor/voltage'] = (kind, [(when + 100 * MS, data) for when, data in messages])
    assert 'clock_skew' in codes(load(write_bag(tmp_path / 'more', topics)))


def test_missing_values_and_wrong_types(tmp_path: Path) -> None:
    topics = motor_topics(motor_record(50))
    kind, messages = topics['/motor/speed']
    messages = list(messages)
    stamp = messages[9][0]
    messages[9] = (stamp, joints(stamp, ['shaft'], [1.0], [np.nan]))
    messages[20] = (messages[20][0], joints(messages[20][0], [], [], []))
    topics['/motor/speed'] = (kind, messages)
    loaded = load(write_bag(tmp_path / 'bag', topics))
    (record,) = loaded.records
    assert len(record) == 50
    assert record.samples['speed'].time.size == 48
    assert 'missing_values' in codes(loaded)
    topics['/motor/speed'] = (VECTOR, topics['/motor/voltage'][1])
    with pytest.raises(UserError, match=r'no field `velocity`.*header, vector'):
        load(write_bag(tmp_path / 'odd', topics))


def joint_states(path: Path, position: list[float], velocity: list[float]) -> Path:
    """Return a bag of a joint whose drive says nothing of its effort."""
    rows = []
    for k, (angle, speed) in enumerate(zip(position, velocity, strict=True)):
        stamp = START + k * MS
        rows.append((stamp, joints(stamp, ['joint_1'], [angle], [speed], [np.nan])))
    return write_bag(path, {'/joint_states': (JOINTS, rows)})


def test_a_field_without_values_costs_no_other(tmp_path: Path) -> None:
    """ros2_control fills what the hardware does not export with NaN."""
    ramp, nothing = [0.1 * k for k in range(50)], [np.nan] * 50
    loaded = load(joint_states(tmp_path / 'both', ramp, ramp), 'ros2_control')
    assert loaded.records[0]['speed'].tolist() == ramp
    assert list(loaded.records[0]) == ['speed', 'position']
    (finding,) = [f for f in loaded.findings if f.code == 'empty_signal']
    assert (finding.severity, finding.message) == ('info', 'no value at all in current; left out')

    loaded = load(joint_states(tmp_path / 'position', ramp, nothing), 'ros2_control')
    assert loaded.records[0]['position'].tolist() == ramp
    assert list(loaded.origins) == ['position']
    found = {f.message: f.severity for f in loaded.findings if f.code == 'empty_signal'}
    assert found['no value at all in speed; left out'] == 'warning'

    with pytest.raises(UserError, match=r'none of the fields .* holds any finite value'):
        load(joint_states(tmp_path / 'none', nothing, nothing), 'ros2_control')
    halves = [[x if k % 2 == way else np.nan for k, x in enumerate(ramp)] for way in (0, 1)]
    with pytest.raises(UserError, match='no message has a finite value of each of position, spee'):
        load(joint_states(tmp_path / 'halves', *halves), 'ros2_control')


def test_a_source_with_values_is_preferred(tmp_path: Path) -> None:
    topics = motor_topics(motor_record(50))
    kind, messages = topics['/motor/voltage']
    topics['/drive/voltage'] = (kind, [(t, vector(t, np.nan)) for t, _ in messages])
    config = tmp_path / 'mine.yaml'
    config.write_text(
        'signals:\n  voltage:\n'
        '    - {topic: drive/voltage, field: vector.x}\n'
        '    - {topic: motor/voltage, field: vector.x}\n'
        '  current: {topic: motor/current, field: vector.x}\n'
        '  supply_voltage: [{topic: drive/voltage, field: vector.x}, {constant: 24}]\n'
    )
    loaded = load(write_bag(tmp_path / 'bag', topics), config)
    assert loaded.origins['voltage'] == '/motor/voltage vector.x'
    assert set(loaded.records[0]['supply_voltage']) == {24.0}
    assert loaded.origins['supply_voltage'] == '24'
    (finding,) = [f for f in loaded.findings if f.code == 'empty_signal']
    assert 'supply_voltage' in finding.message


def test_a_missing_topic_is_said_with_those_that_are_there(tmp_path: Path) -> None:
    topics = motor_topics(motor_record(50))
    topics['/other/volts'] = topics.pop('/motor/voltage')
    loaded = load(write_bag(tmp_path / 'bag', topics))
    assert 'voltage' not in loaded.records[0]
    (finding,) = [f for f in loaded.findings if f.code == 'missing_topic']
    assert 'no input was recorded: the bag has no `motor/voltage`' in finding.message
    assert '/other/volts' in finding.message


def test_messages_in_order_for_replay(bag: Path) -> None:
    rows = list(Bag(bag).iterate(['/motor/speed', '/motor/voltage']))
    assert len(rows) == 2 * 13_334
    assert [row[1] for row in rows] == sorted(row[1] for row in rows)
    assert {row[0] for row in rows} == {'/motor/speed', '/motor/voltage'}
