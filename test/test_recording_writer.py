"""The bag writer: what it writes can be read by others, also after a kill."""

from pathlib import Path
import signal
import sqlite3
import subprocess
import sys
import tempfile

from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from recording_tools import motor_record, MS, START, types, vector
from rosbags.highlevel import AnyReader
import yaml

from motor_sysid.errors import UserError
from motor_sysid.recording import load
from motor_sysid.recording.rosbag import Bag
from motor_sysid.recording.save import CARRIED, write_record
from motor_sysid.recording.writer import BagWriter
from motor_sysid.signals import Record
from motor_sysid.signals.channels import BY_NAME, CHANNELS

VECTOR = 'geometry_msgs/msg/Vector3Stamped'

KILLED = """
import sys, time
from motor_sysid.recording.writer import BagWriter
sys.path.insert(0, {tests!r})
from recording_tools import vector, START, MS
bag = BagWriter({path!r}, {storage!r}, commit_period=0.05)
for topic in ('/motor/voltage', '/motor/current'):
    bag.add_topic(topic, 'geometry_msgs/msg/Vector3Stamped')
k = 0
while True:
    for topic in ('/motor/voltage', '/motor/current'):
        bag.write(topic, START + k * MS, vector(START + k * MS, k))
    k += 1
    if k % 1000 == 0:
        print(k, flush=True)
    if k % 10 == 0:
        time.sleep(0.001)
"""


@pytest.mark.parametrize('storage', ['sqlite3', 'mcap'])
def test_killed_writer_leaves_what_it_committed(tmp_path: Path, storage: str) -> None:
    path = tmp_path / 'bag'
    tests = str(Path(__file__).parent)
    code = KILLED.format(path=str(path), storage=storage, tests=tests)
    with subprocess.Popen([sys.executable, '-c', code], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        seen = [process.stdout.readline() for _ in range(3)][-1]
        process.send_signal(signal.SIGKILL)
    written = int(seen)
    loaded = load(path)
    record = loaded.records[0]
    assert len(record) > written - 1500
    assert np.array_equal(record['voltage'], np.arange(len(record)))
    assert 'missing_metadata' in {finding.code for finding in loaded.findings}


@pytest.mark.parametrize('storage', ['sqlite3', 'mcap'])
def test_others_read_it(tmp_path: Path, storage: str) -> None:
    record = motor_record(100)
    write_record(record, tmp_path / 'bag', storage=storage)
    with AnyReader([tmp_path / 'bag'], default_typestore=types()) as reader:
        read = [
            reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
            if connection.topic == '/motor/speed'
        ]
    assert [message.velocity[0] for message in read] == record['speed'].tolist()
    assert read[1].header.stamp.nanosec == 1_000_000
    metadata = yaml.safe_load((tmp_path / 'bag' / 'metadata.yaml').read_text())
    information = metadata['rosbag2_bagfile_information']
    assert (information['version'], information['message_count']) == (9, 300)


class Seconds:
    nanoseconds = 9_223_372_036_854_775_807


class Offered:
    history, depth, reliability, durability, liveliness = 3, 0, 2, 1, 1
    deadline = lifespan = liveliness_lease_duration = Seconds()
    avoid_ros_namespace_conventions = False


def test_offered_qos_and_custom_data_are_kept(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag', custom_data={'seed': '7'}) as bag:
        bag.add_topic('/a', VECTOR, [Offered()])
        bag.write('/a', START, vector(START, 1.0))
        assert bag.counts == {'/a': 1}
    information = yaml.safe_load((tmp_path / 'bag' / 'metadata.yaml').read_text())
    (topic,) = information['rosbag2_bagfile_information']['topics_with_message_count']
    (qos,) = topic['topic_metadata']['offered_qos_profiles']
    assert (qos['reliability'], qos['durability']) == ('best_effort', 'transient_local')
    assert qos['deadline'] == {'sec': 9223372036, 'nsec': 854775807}
    read = Bag(tmp_path / 'bag')
    assert read.custom_data == {'seed': '7'}
    assert read.topics['/a'].digest.startswith('RIHS01_')


def test_close_is_safe(tmp_path: Path) -> None:
    bag = BagWriter(tmp_path / 'bag')
    bag.add_topic('/a', VECTOR)
    bag.add_topic('/a', VECTOR)
    bag.close()
    bag.close()
    bag.flush()
    with pytest.raises(UserError, match='closed already'):
        bag.write('/a', START, b'')


def test_an_exception_does_not_lose_the_recording(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), BagWriter(tmp_path / 'bag') as bag:  # noqa: PT012
        bag.add_topic('/motor/voltage', VECTOR)
        for k in range(20):
            bag.write('/motor/voltage', START + k * MS, vector(START + k * MS, k))
        raise KeyboardInterrupt
    assert len(load(tmp_path / 'bag').records[0]) == 20


def test_what_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match='exists already'):
        BagWriter(tmp_path)
    with pytest.raises(UserError, match='sqlite3 or mcap'):
        BagWriter(tmp_path / 'a', 'rosbag1')
    with pytest.raises(UserError, match='only mcap'):
        BagWriter(tmp_path / 'a', compress=True)
    with BagWriter(tmp_path / 'b') as bag, pytest.raises(UserError, match='not part of ROS 2'):
        bag.add_topic('/a', 'my_msgs/msg/Own')
    with pytest.raises(UserError, match='a bag is a folder'):
        write_record(motor_record(10), tmp_path / 'a.mcap')
    with pytest.raises(UserError, match='cannot be written'):
        write_record(motor_record(10), tmp_path / 'no' / 'a.csv')


def test_linear_axis_and_phases_come_back(tmp_path: Path) -> None:
    time = np.arange(50) / 100
    ramp = np.sin(time)
    axis = Record(
        time,
        {'force': ramp, 'position': 2 * ramp, 'position_reference': 3 * ramp},
        {'force': 'N', 'position': 'm', 'position_reference': 'm'},
    )
    write_record(axis, tmp_path / 'axis')
    read = load(tmp_path / 'axis').records[0]
    assert read.units == {'force': 'N', 'position': 'm', 'position_reference': 'm'}
    assert all(np.array_equal(read[name], axis[name]) for name in axis)
    phases = ['voltage_a', 'voltage_b', 'voltage_c', 'current_a']
    names = ['voltage', 'current', *phases, 'hall_sector']
    units = {n: 'A' if 'current' in n else 'V' for n in names} | {'hall_sector': '1'}
    bldc = Record(time, {name: k * ramp for k, name in enumerate(names)}, units)
    write_record(bldc, tmp_path / 'bldc', storage='mcap')
    read = load(tmp_path / 'bldc').records[0]
    assert all(np.array_equal(read[name], bldc[name]) for name in names)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=25)
@given(st.sets(st.sampled_from(sorted(CARRIED)), min_size=1))
def test_any_signals_come_back_and_no_others(tmp_path: Path, names: set[str]) -> None:
    rows = np.random.default_rng(len(names)).standard_normal((len(names), 20))
    units = {name: BY_NAME[name].units[0] for name in names}
    record = Record(np.arange(20) / 100, dict(zip(sorted(names), rows, strict=True)), units)
    path = Path(tempfile.mkdtemp(dir=tmp_path)) / 'bag'
    write_record(record, path)
    (read,) = load(path).records
    assert set(read) == names
    assert all(np.array_equal(read[name], record[name]) for name in names)


def test_a_signal_without_a_topic_is_refused(tmp_path: Path) -> None:
    assert {channel.name for channel in CHANNELS} - {'acceleration'} == CARRIED
    record = motor_record(20)
    record = record.with_signal('acceleration', record['speed'], 'rad/s^2')
    with pytest.raises(UserError, match=r'no topic carries acceleration; write a \.csv'):
        write_record(record, tmp_path / 'bag')
    assert not (tmp_path / 'bag').exists()


def test_a_reader_may_look_while_it_is_written(tmp_path: Path) -> None:
    bag = BagWriter(tmp_path / 'bag', commit_period=0.0)
    bag.add_topic('/motor/voltage', VECTOR)
    for k in range(30):
        bag.write('/motor/voltage', START + k * MS, vector(START + k * MS, k))
    bag.flush()
    assert len(load(tmp_path / 'bag').records[0]) == 30
    with sqlite3.connect(tmp_path / 'bag' / 'bag.db3') as database:
        assert database.execute('SELECT count(*) FROM messages').fetchone() == (30,)
    bag.close()
