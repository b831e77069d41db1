"""Write a record to a CSV or a bag that `load` reads back as it was."""

from collections.abc import Iterator, Mapping
from functools import cache
import gzip
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import get_typestore, Stores
from rosbags.typesys.store import Typestore

from motor_sysid.errors import UserError
from motor_sysid.recording.cdr import find
from motor_sysid.recording.definitions import definitions, Types
from motor_sysid.recording.field_path import parse_path
from motor_sysid.recording.messages import Topic
from motor_sysid.recording.writer import BagWriter
from motor_sysid.signals.record import Record

if TYPE_CHECKING:
    from rosbags.typesys.store import Msg

VECTOR = 'geometry_msgs/msg/Vector3Stamped'
JOINT = 'sensor_msgs/msg/JointState'
START = 1_700_000_000_000_000_000
"""Stamp (ns) of time 0 in a bag made from a record, unless another is given."""
ALONE = {
    'speed_reference': 'motor/reference', 'voltage_command': 'motor/voltage_command',
    'current_command': 'motor/current_command',
    'duty': 'motor/duty', 'supply_voltage': 'motor/supply_voltage', 'torque': 'motor/torque',
    'force': 'motor/force', 'temperature': 'motor/temperature',
    'position_reference': 'motor/position_reference', 'hall_sector': 'motor/hall_sector',
}  # fmt: skip
"""Signals that have a topic of their own, as x of a vector."""
KINDS = ('voltage', 'current')
FRAMES = {'dc': ('',), 'abc': ('_a', '_b', '_c'), 'dq': ('_d', '_q')}
"""`frame_id` to what follows the name of a voltage or current, as x, y, z of one vector."""
BAGS = ('.mcap', '.db3')
OTHERS = frozenset({
    '.bag', '.gz', '.h5', '.hdf5', '.json', '.log', '.mat', '.npy', '.npz', '.parquet', '.tsv',
    '.txt', '.xls', '.xlsx', '.yaml', '.yml', '.zip', '.zst', '.zstd',
})  # fmt: skip
"""How files of other kinds end; a bag folder of such a name would be taken for one."""
CARRIED = {
    'speed', 'position', *ALONE, *(k + axis for k in KINDS for f in FRAMES.values() for axis in f)
}
"""Signals that a bag can carry."""


def write_record(
    record: Record,
    path: str | Path,
    *,
    storage: str = 'sqlite3',
    compress: bool = False,
    start: int = START,
) -> None:
    """Write a record to ``.csv``, ``.csv.gz``, or else to a bag folder with the default topics.

    Parameters
    ----------
    record:
        The record.
    path:
        File or folder to create.
    storage:
        ``sqlite3`` or ``mcap``, for a bag.
    compress:
        Compress the bag (mcap only).
    start:
        Stamp of time 0 in ns, for a bag; its stamps are whole nanoseconds.

    Raises
    ------
    UserError
        If the path cannot be written, is named like a file of another kind, or a signal has no
        topic.
    """
    path = Path(path)
    try:
        if is_table(path):
            packed = path.suffix.lower() == '.gz'
            path.write_bytes(gzip.compress(_csv(record), mtime=0) if packed else _csv(record))
        else:
            _refuse_without_topic(record, path)
            with BagWriter(path, storage, compress=compress, commit_period=np.inf) as bag:
                _write_bag(record, bag, start)
    except OSError as error:
        raise UserError(f'{path} cannot be written: {error.strerror or error}') from None


def is_table(path: Path) -> bool:
    """Tell by its name whether a record is written as a table, and not as a bag folder.

    Raises
    ------
    UserError
        If the name is that of a file of another kind.
    """
    ending = path.suffix.lower()
    if path.name.lower().endswith(('.csv', '.csv.gz')):
        return True
    if ending in BAGS:
        raise UserError(f'{path}: a bag is a folder; give its name without {path.suffix}')
    if ending in OTHERS:
        raise UserError(
            f'{path}: no {path.suffix} is written; name a .csv, a .csv.gz or a bag folder'
        )
    return False


def _refuse_without_topic(record: Record, path: Path) -> None:
    left = [name for name in record if name not in CARRIED]
    if left:
        raise UserError(
            f'bag {path}: no topic carries {", ".join(left)}; write a .csv, or leave it out with '
            '`record.select`'
        )


def _csv(record: Record) -> bytes:
    header = ','.join(['time [s]', *(f'{name} [{record.units[name]}]' for name in record)])
    columns = [record.time, *(record[name] for name in record)]
    rows = zip(*(map(repr, column.tolist()) for column in columns), strict=True)
    return '\n'.join([header, *map(','.join, rows), '']).encode()


def _write_bag(record: Record, bag: BagWriter, start: int) -> None:
    stamps = start + np.round(record.time * 1e9).astype(np.int64)
    messages = list(_messages(record, stamps))
    for topic, msgtype, _ in messages:
        bag.add_topic(topic, msgtype)
    for k, stamp in enumerate(stamps.tolist()):
        for topic, _, rows in messages:
            bag.write(topic, stamp, rows[k].tobytes())


def _messages(
    record: Record, stamps: NDArray[np.int64]
) -> Iterator[tuple[str, str, NDArray[np.uint8]]]:
    """Yield topic, type and (N, L) bytes of the messages that carry the record."""
    phases = _has(record, 'abc')
    alone = not phases and not _has(record, 'dq')
    for kind in KINDS:
        for frame, axes in FRAMES.items():
            names = [kind + axis for axis in axes]
            if any(name in record for name in names) and (alone or frame != 'dc'):
                beside = '_dq' if phases and frame == 'dq' else ''
                yield f'/motor/{kind}{beside}', VECTOR, _vectors(record, stamps, names, frame)
    if not alone and _has(record, 'dc'):
        yield '/motor/command', VECTOR, _vectors(record, stamps, ['voltage', 'current'], 'command')
    if 'speed' in record or 'position' in record:
        yield '/motor/speed', JOINT, _joints(record, stamps)
    for name, topic in ALONE.items():
        if name in record:
            linear = record.units[name] in {'m', 'm/s'}
            frame = 'linear' if linear else 'dc'
            yield f'/{topic}', VECTOR, _vectors(record, stamps, [name], frame)


def _has(record: Record, frame: str) -> bool:
    return any(kind + axis in record for kind in KINDS for axis in FRAMES[frame])


def _vectors(
    record: Record, stamps: NDArray[np.int64], names: list[str], frame: str
) -> NDArray[np.uint8]:
    types = _store().types
    header = _header(frame)
    vector = types['geometry_msgs/msg/Vector3'](x=0.0, y=0.0, z=0.0)
    fields = {f'vector.{axis}': name for axis, name in zip('xyz', names, strict=False)}
    message = types[VECTOR](header=header, vector=vector)
    return _filled(message, VECTOR, record, stamps, fields)


def _joints(record: Record, stamps: NDArray[np.int64]) -> NDArray[np.uint8]:
    linear = any(record.units.get(name) in {'m', 'm/s'} for name in ('speed', 'position'))
    present = {
        field: name for field, name in (('position', 'position'), ('velocity', 'speed'))
        if name in record
    }  # fmt: skip
    message = _store().types[JOINT](
        header=_header('linear' if linear else 'motor'),
        name=['motor_shaft'],
        position=np.zeros(int('position' in present)),
        velocity=np.zeros(int('velocity' in present)),
        effort=np.empty(0),
    )
    fields = {f'{field}[0]': name for field, name in present.items()}
    return _filled(message, JOINT, record, stamps, fields)


def _filled(
    message: object,
    msgtype: str,
    record: Record,
    stamps: NDArray[np.int64],
    fields: Mapping[str, str],
) -> NDArray[np.uint8]:
    """Serialise one message, and put the numbers of each row where its fields lie: (N, L).

    What the record lacks is not a number, lest it reads back as zero.
    """
    data = bytes(_store().serialize_cdr(message, msgtype))
    rows = np.tile(np.frombuffer(data, np.uint8), (len(record), 1))

    def put(path: str, values: NDArray[np.generic]) -> None:
        offset = find(data, _types(), msgtype, parse_path(path)).offset
        size = values.dtype.itemsize
        rows[:, offset : offset + size] = values.view(np.uint8).reshape(-1, size)

    seconds, rest = np.divmod(stamps, 1_000_000_000)
    put('header.stamp.sec', seconds.astype('<i4'))
    put('header.stamp.nanosec', rest.astype('<u4'))
    lacking = np.full(len(record), np.nan)
    for path, name in fields.items():
        put(path, record.signals.get(name, lacking).astype('<f8'))
    return rows


def _header(frame: str) -> 'Msg':
    types = _store().types
    stamp = types['builtin_interfaces/msg/Time'](sec=0, nanosec=0)
    return types['std_msgs/msg/Header'](stamp=stamp, frame_id=frame)


@cache
def _store() -> Typestore:
    return get_typestore(Stores.ROS2_JAZZY)


@cache
def _types() -> Types:
    return definitions([Topic('', VECTOR), Topic('', JOINT)])
