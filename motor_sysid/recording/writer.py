"""Write rosbag2 recordings that stay readable when the writer is killed."""

from collections.abc import Mapping, Sequence
import os
from pathlib import Path
import sqlite3
import time
from types import TracebackType
from typing import Protocol

from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer, WriterError
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer
from rosbags.typesys import get_typestore, Stores, TypesysError
from rosbags.typesys.store import Typestore

from motor_sysid.errors import UserError

STORAGES = {'sqlite3': StoragePlugin.SQLITE3, 'mcap': StoragePlugin.MCAP}


class Duration(Protocol):
    """A duration, such as rclpy's."""

    nanoseconds: int


class OfferedQos(Protocol):
    """What a publisher offers, with the attributes of rclpy's ``QoSProfile``."""

    history: int
    depth: int
    reliability: int
    durability: int
    deadline: Duration
    lifespan: Duration
    liveliness: int
    liveliness_lease_duration: Duration
    avoid_ros_namespace_conventions: bool


class BagWriter:
    """Writes raw CDR messages into a new bag folder.

    What is written is brought to the disk about once a second, so that a kill or a power cut costs
    no more than that: sqlite3 stays a valid database, mcap can be read up to its last chunk.
    Metadata is written by `close`, which may be called twice; leaving the context closes also
    after an exception.

    Parameters
    ----------
    path:
        Folder to create.
    storage:
        ``sqlite3`` or ``mcap``.
    compress:
        Compress chunks with zstd (mcap only).
    commit_period:
        Time between commits in s.
    custom_data:
        Texts for ``custom_data`` of metadata.yaml.

    Raises
    ------
    UserError
        If the folder exists or cannot be created.
    """

    def __init__(
        self,
        path: str | Path,
        storage: str = 'sqlite3',
        *,
        compress: bool = False,
        commit_period: float = 1.0,
        custom_data: Mapping[str, str] | None = None,
    ) -> None:
        if storage not in STORAGES:
            raise UserError(f'storage `{storage}` is not known; choose {" or ".join(STORAGES)}')
        if compress and storage != 'mcap':
            raise UserError('only mcap storage can be compressed; choose it, or leave compression')
        self.path = Path(path)
        self.counts: dict[str, int] = {}
        self._period = commit_period
        self._connections: dict[str, Connection] = {}
        self._committed = time.monotonic()
        self._dirty = False
        self._typestore: Typestore | None = None
        try:
            self._writer = Writer(self.path, version=9, storage_plugin=STORAGES[storage])
            if compress:
                self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            for key, value in (custom_data or {}).items():
                self._writer.set_custom_data(key, value)
            self._writer.open()
        except WriterError:
            raise UserError(f'{path} exists already; choose another name for the bag') from None
        except (OSError, sqlite3.Error) as error:
            raise UserError(f'bag {path} cannot be created: {error}') from None
        self._open = True

    def add_topic(
        self,
        name: str,
        msgtype: str,
        qos: Sequence[OfferedQos] = (),
        *,
        definition: str | None = None,
        digest: str | None = None,
    ) -> None:
        """Announce a topic before its first message.

        Parameters
        ----------
        name, msgtype:
            E.g. ``/motor/speed`` and ``sensor_msgs/msg/JointState``.
        qos:
            What its publishers offer.
        definition, digest:
            Message definition and RIHS01 hash of a type that ROS 2 Jazzy does not ship.

        Raises
        ------
        UserError
            If the type is not known, or the bag cannot be written.
        """
        if name in self._connections:
            return
        if definition is None and (reason := self.refusal(name, msgtype)):
            raise UserError(reason)
        try:
            self._connections[name] = self._writer.add_connection(
                name,
                msgtype,
                typestore=None if definition is not None else self._types(),
                msgdef=definition,
                rihs01=digest,
                offered_qos_profiles=[_qos(profile) for profile in qos],
            )
        except (OSError, sqlite3.Error) as error:
            raise UserError(f'bag {self.path} cannot be written: {error}') from None
        self.counts[name] = 0
        self._dirty = True
        self.flush()

    def refusal(self, name: str, msgtype: str) -> str:
        """Return why a topic needs a definition of its type; empty if ROS 2 Jazzy has it."""
        try:
            self._types().generate_msgdef(msgtype, ros_version=2)
        except (KeyError, TypesysError):
            return (
                f'message type `{msgtype}` of `{name}` is not part of ROS 2 Jazzy; '
                'give its definition to record it'
            )
        return ''

    def write(self, topic: str, received: int, data: bytes) -> None:
        """Write one message.

        Parameters
        ----------
        topic:
            A topic that was added.
        received:
            Time of reception in ns.
        data:
            CDR bytes as they came.
        """
        if not self._open:
            raise UserError(f'bag {self.path} is closed already')
        try:
            self._writer.write(self._connections[topic], received, data)
        except (OSError, sqlite3.Error) as error:
            raise UserError(f'bag {self.path} cannot be written: {error}') from None
        self.counts[topic] += 1
        self._dirty = True
        if time.monotonic() - self._committed > self._period:
            self.flush()

    def flush(self) -> None:
        """Have everything written so far survive a power cut; `write` does so once a second."""
        if not (self._open and self._dirty):
            return
        storage = self._writer.storage
        try:
            # Internals of rosbags 0.11, which offers no commit; the version is pinned.
            if isinstance(storage, Sqlite3Writer):
                storage.conn.commit()
            elif isinstance(storage, McapWriter):
                if storage.chunk.msgs:
                    storage.close_chunk()
                storage.bio.flush()
                os.fsync(storage.bio.fileno())
        except (OSError, sqlite3.Error) as error:
            raise UserError(f'bag {self.path} cannot be written: {error}') from None
        self._dirty = False
        self._committed = time.monotonic()

    def close(self) -> None:
        """Write the metadata and close; a second call does nothing."""
        if not self._open:
            return
        self._open = False
        try:
            self._writer.close()
        except (OSError, sqlite3.Error) as error:
            raise UserError(f'bag {self.path} cannot be closed: {error}') from None

    def __enter__(self) -> 'BagWriter':
        """Return the writer."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close, also after an exception: what was recorded is kept."""
        self.close()

    def _types(self) -> Typestore:
        if self._typestore is None:
            self._typestore = get_typestore(Stores.ROS2_JAZZY)
        return self._typestore


def _qos(profile: OfferedQos) -> Qos:
    """Translate an rclpy profile; the enumerations of rosbags have the same integers."""
    return Qos(
        QosHistory(int(profile.history)),
        int(profile.depth),
        QosReliability(int(profile.reliability)),
        QosDurability(int(profile.durability)),
        _time(profile.deadline),
        _time(profile.lifespan),
        QosLiveliness(int(profile.liveliness)),
        _time(profile.liveliness_lease_duration),
        bool(profile.avoid_ros_namespace_conventions),
    )


def _time(duration: Duration) -> QosTime:
    return QosTime(*divmod(int(duration.nanoseconds), 1_000_000_000))
