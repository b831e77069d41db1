"""The recorder's thread: what goes wrong there is heard of, and what waits there is bounded."""

from collections.abc import Callable
from pathlib import Path
import sqlite3
import threading

import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from rclpy.node import Node
from ros_harness import wait_for
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer
from test_nodes_pipeline import VECTOR, vector

from motor_sysid.errors import UserError
from motor_sysid.nodes import bag_thread
from motor_sysid.nodes.bag_thread import BagThread
from motor_sysid.nodes.loop import LoopNode
from motor_sysid.nodes.publishing import vector_publisher
from motor_sysid.nodes.recorder import RecorderNode
from motor_sysid.recording.rosbag import Bag
from motor_sysid.recording.writer import BagWriter

pytestmark = pytest.mark.timeout(60)

FULL = 'database or disk is full'


@pytest.fixture
def thread(tmp_path: Path) -> BagThread:
    return BagThread(lambda: BagWriter(tmp_path / 'bag'))


def full(*given: object) -> None:
    raise sqlite3.OperationalError(FULL)


def test_a_type_is_refused_and_the_bag_goes_on(thread: BagThread, tmp_path: Path) -> None:
    assert 'give its definition' in thread.add_topic('/own', 'my_msgs/msg/Own', [])
    assert thread.add_topic('/a', VECTOR, []) == ''
    thread.write('/a', [(1, vector(1, 1.0))])
    thread.close()
    assert len(Bag(tmp_path / 'bag').read(['/a'])['/a']) == thread.written == 1


def test_a_disk_that_fills_with_a_new_topic_ends_the_recording(
    thread: BagThread, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Sqlite3Writer, 'add_connection', full)
    calls = (
        lambda: thread.add_topic('/a', VECTOR, []),
        lambda: thread.add_topic('/b', VECTOR, []),
        lambda: thread.write('/a', [(1, b'')]),
        thread.flush,
        thread.close,
    )
    for call in calls:
        with pytest.raises(UserError, match=rf'bag .*bag cannot be written: {FULL}'):
            call()


def test_whatever_ends_the_thread_is_told(
    thread: BagThread, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert thread.add_topic('/a', VECTOR, []) == ''

    def fail(*given: object) -> None:
        raise RuntimeError('broken')

    monkeypatch.setattr(BagWriter, 'write', fail)
    thread.write('/a', [(1, b'')])
    with pytest.raises(UserError, match='cannot be written: RuntimeError: broken'):
        thread.add_topic('/b', VECTOR, [])
    with pytest.raises(UserError, match='RuntimeError: broken'):
        thread.close()
    with pytest.raises(UserError, match='RuntimeError: broken'):
        BagThread(fail)


def test_what_waits_for_the_disk_is_bounded_in_bytes(
    thread: BagThread, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bag_thread, 'LIMIT', 100_000)
    slow, wrote = threading.Event(), threading.Event()
    monkeypatch.setattr(BagWriter, 'write', lambda *given: slow.wait() and wrote.set())
    thread.write('/a', [(1, bytes(60_000))])
    with pytest.raises(UserError, match=r'more than 0\.1 MB wait for the disk'):
        thread.write('/a', [(2, bytes(60_000))])
    slow.set()
    wait_for(lambda: thread._done >= 60_000, 'the disk')
    for k in range(10):
        thread.write('/a', [(k, bytes(30_000))])
        wait_for(lambda k=k: thread.written == k + 2, 'the disk')
    with pytest.raises(UserError, match='wait for the disk'):
        thread.write('/a', [(1, b'')] * 1000)
    thread.close()


@pytest.mark.parametrize('storage', ['sqlite3', 'mcap'])
def test_a_flush_reaches_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, storage: str
) -> None:
    synced: list[int] = []
    monkeypatch.setattr('os.fsync', synced.append)
    with BagWriter(tmp_path / 'bag', storage) as bag:
        bag.add_topic('/a', VECTOR)
        bag.write('/a', 1, vector(1, 1.0))
        bag.flush()
        if storage == 'mcap':
            assert synced == [bag._writer.storage.bio.fileno()] * 2
        else:  # sqlite3 does so itself
            ask = bag._writer.storage.conn.execute
            assert ask('PRAGMA synchronous').fetchone()[0] >= 2


def test_a_full_disk_ends_the_recorder_at_a_new_topic(
    make_node: Callable[..., LoopNode], other: Node, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    node = make_node(RecorderNode, path=str(tmp_path / 'bag'))
    monkeypatch.setattr(Sqlite3Writer, 'add_connection', full)
    vector_publisher(other, 'motor/voltage', 'dc')

    def step() -> bool:
        node._next_look = 0.0
        node.step()
        return bool(node._topics or node._refused)

    with pytest.raises(UserError, match=FULL):
        wait_for(step, 'the topic')
    with pytest.raises(UserError, match=FULL):
        node.close()
