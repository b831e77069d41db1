"""Records and bags that the tests of recording make up."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
from rosbags.typesys.store import Typestore

from motor_sysid.recording.writer import BagWriter
from motor_sysid.signals import Record

START = 1_700_000_000_000_000_000
MS = 1_000_000
UNITS = {'voltage': 'V', 'current': 'A', 'speed': 'rad/s', 'position': 'rad'}
CUSTOM = """\
builtin_interfaces/Time when
string label
demo_msgs/Joint[] joints
"""
JOINT = """\
string[] names
float32[3] fixed
float64[] values
"""


def motor_record(count: int = 2000, dt: float = 1e-3, seed: int = 0) -> Record:
    """Return a plain DC motor under random steps, with noise on the current, exact else."""
    rng = np.random.default_rng(seed)
    voltage = np.repeat(rng.uniform(-12, 12, count // 50 + 1), 50)[:count]
    speed, current = np.zeros(count), np.zeros(count)
    for k in range(count - 1):
        current[k + 1] = 0.5 * current[k] + 0.5 * (voltage[k] - 0.05 * speed[k]) / 2
        speed[k + 1] = speed[k] + dt * (0.05 * current[k] - 1e-4 * speed[k]) / 2e-5
    position = np.concatenate(([0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * dt)))
    current += 0.01 * rng.standard_normal(count)
    signals = {'voltage': voltage, 'current': current, 'speed': speed, 'position': position}
    return Record(dt * np.arange(count), signals, UNITS)


@cache
def types() -> Typestore:
    """Return the types of ROS 2 Jazzy and one custom type."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(JOINT, 'demo_msgs/msg/Joint'))
    store.register(get_types_from_msg(CUSTOM, 'demo_msgs/msg/State'))
    return store


def header(stamp: int, frame: str = '') -> object:
    """Return a header with a stamp in ns."""
    seconds, rest = divmod(int(stamp), 1_000_000_000)
    time = types().types['builtin_interfaces/msg/Time'](sec=seconds, nanosec=rest)
    return types().types['std_msgs/msg/Header'](stamp=time, frame_id=frame)


def vector(stamp: int, x: float, y: float = 0.0, frame: str = 'dc') -> bytes:
    """Return a Vector3Stamped as CDR."""
    name = 'geometry_msgs/msg/Vector3Stamped'
    xyz = types().types['geometry_msgs/msg/Vector3'](x=float(x), y=float(y), z=0.0)
    message = types().types[name](header=header(stamp, frame), vector=xyz)
    return bytes(types().serialize_cdr(message, name))


def joints(
    stamp: int, names: Sequence[str], position: Sequence[float], velocity: Sequence[float],
    effort: Sequence[float] = (),
) -> bytes:  # fmt: skip
    """Return a JointState as CDR."""
    name = 'sensor_msgs/msg/JointState'
    message = types().types[name](
        header=header(stamp), name=list(names), position=np.array(position, dtype=float),
        velocity=np.array(velocity, dtype=float), effort=np.array(effort, dtype=float),
    )  # fmt: skip
    return bytes(types().serialize_cdr(message, name))


def custom(stamp: int, label: str, values: Mapping[str, float]) -> bytes:
    """Return a message of the custom type: values of two joints by name."""
    make = types().types
    time = header(stamp).stamp  # type: ignore[attr-defined]
    joint = make['demo_msgs/msg/Joint'](
        names=list(values), fixed=np.arange(3, dtype=np.float32),
        values=np.array(list(values.values()), dtype=float),
    )  # fmt: skip
    other = make['demo_msgs/msg/Joint'](
        names=['odd'], fixed=np.zeros(3, np.float32), values=np.array([7.0])
    )
    message = make['demo_msgs/msg/State'](when=time, label=label, joints=[other, joint])
    return bytes(types().serialize_cdr(message, 'demo_msgs/msg/State'))


Topic = tuple[str, Sequence[tuple[int, bytes]]]
"""Type, and (receive time, CDR) of each message."""


def write_bag(path: Path, topics: Mapping[str, Topic], storage: str = 'sqlite3') -> Path:
    """Write topics into a new bag, in the order of reception."""
    rows = [
        (received, name, data)
        for name, (_, messages) in topics.items()
        for received, data in messages
    ]
    kinds = {name: msgtype for name, (msgtype, _) in topics.items()}
    return write_rows(path, kinds, sorted(rows, key=lambda row: row[0]), storage)


def write_rows(
    path: Path, kinds: Mapping[str, str], rows: Sequence[tuple[int, str, bytes]],
    storage: str = 'sqlite3',
) -> Path:  # fmt: skip
    """Write (receive time, topic, CDR) into a new bag as they come; `kinds` are the types."""
    with BagWriter(path, storage) as bag:
        for name, msgtype in kinds.items():
            own = msgtype.startswith('demo_msgs')
            bag.add_topic(
                name, msgtype,
                definition=types().generate_msgdef(msgtype, ros_version=2)[0] if own else None,
                digest=types().hash_rihs01(msgtype) if own else None,
            )  # fmt: skip
        for received, name, data in rows:
            bag.write(name, received, data)
    return path


def motor_topics(
    record: Record, delay: Callable[[int], int] = lambda k: 0, lag: int = 0
) -> dict[str, Topic]:
    """Return a record as default topics.

    Parameters
    ----------
    record:
        With voltage, current, speed and position.
    delay:
        Row to its transport delay in ns.
    lag:
        Added to the stamps of the voltage, in ns.
    """
    stamps: NDArray[np.int64] = START + np.round(record.time * 1e9).astype(np.int64)
    rows = list(enumerate(stamps.tolist()))
    kind = 'geometry_msgs/msg/Vector3Stamped'
    voltage = [(s + delay(k), vector(s + lag, record['voltage'][k])) for k, s in rows]
    current = [(s + delay(k), vector(s, record['current'][k])) for k, s in rows]
    speed = [
        (s + delay(k), joints(s, ['shaft'], [record['position'][k]], [record['speed'][k]]))
        for k, s in rows
    ]
    return {
        '/motor/voltage': (kind, voltage),
        '/motor/current': (kind, current),
        '/motor/speed': ('sensor_msgs/msg/JointState', speed),
    }
