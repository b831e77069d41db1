"""Messages of one topic as columns: receive times and one block of bytes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Stamps = NDArray[np.int64]


@dataclass(frozen=True)
class Topic:
    """A topic as a bag describes it.

    Attributes
    ----------
    name, msgtype:
        E.g. ``/motor/speed`` and ``sensor_msgs/msg/JointState``.
    definition, encoding:
        Text of the message definition stored in the bag and its language (``ros2msg`` or
        ``ros2idl``); empty where the bag stores none.
    digest:
        RIHS01 hash of the type, empty if unknown.
    qos:
        Offered QoS profiles as YAML text.
    serialization:
        ``cdr`` in every bag that ROS 2 writes.
    """

    name: str
    msgtype: str
    definition: str = ''
    encoding: str = ''
    digest: str = ''
    qos: str = ''
    serialization: str = 'cdr'


def _none() -> Stamps:
    return np.empty(0, np.int64)


@dataclass(frozen=True)
class Messages:
    """The messages of one topic.

    Attributes
    ----------
    received:
        (N,) ns, when the recorder got each message.
    blob:
        (B,) uint8, all messages one after the other.
    lengths:
        (N,) bytes of each message; their sum is B.
    places:
        (N,) grow in the order in which the messages of all topics were stored.
    shown:
        (N,) ns, what the recorder's clock showed then: `received`, but for clocks that were set
        back (see `motor_sysid.recording.reception`).
    """

    received: Stamps = field(default_factory=_none)
    blob: Bytes = field(default_factory=lambda: np.empty(0, np.uint8))
    lengths: Stamps = field(default_factory=_none)
    places: Stamps = field(default_factory=_none)
    shown: Stamps = field(default_factory=_none)

    def __len__(self) -> int:
        """Return the number of messages."""
        return int(self.lengths.size)

    def __getitem__(self, index: int) -> bytes:
        """Return the bytes of one message."""
        end = int(self.ends[index])
        return self.blob[end - int(self.lengths[index]) : end].tobytes()

    def __iter__(self) -> Iterator[bytes]:
        """Iterate over the bytes of each message."""
        data = self.blob.tobytes()
        end = 0
        for length in self.lengths.tolist():
            yield data[end : end + length]
            end += length

    @property
    def ends(self) -> Stamps:
        """(N,) position in `blob` behind each message."""
        return np.asarray(np.cumsum(self.lengths), dtype=np.int64)

    def groups(self) -> Iterator[tuple[Stamps, Bytes]]:
        """Group messages of equal length: (n,) indices and the (n, length) bytes."""
        if len(self) == 0:
            return
        if np.all(self.lengths == self.lengths[0]):
            yield np.arange(len(self)), self.blob.reshape(len(self), int(self.lengths[0]))
            return
        starts = self.ends - self.lengths
        for length in np.unique(self.lengths):
            rows = np.flatnonzero(self.lengths == length)
            yield rows, self.blob[starts[rows, None] + np.arange(length)]

    def behind(self, place: int) -> 'Messages':
        """Return the messages as they lie in a file or chunk that begins at that place."""
        return replace(self, places=self.places + place)

    def sorted_by(self, keys: Stamps) -> 'Messages':
        """Return the messages in the order of (N,) keys (stable)."""
        if np.all(np.diff(keys) >= 0):
            return self
        order = np.argsort(keys, kind='stable')
        parts = list(self)
        blob = b''.join(parts[i] for i in order)
        return Messages(
            self.received[order], np.frombuffer(blob, np.uint8), self.lengths[order],
            self.places[order], self.shown[order],
        )  # fmt: skip


def stored(received: Stamps, blob: Bytes, lengths: Stamps, places: Stamps) -> Messages:
    """Return messages as they lie in a file."""
    return Messages(received, blob, lengths, places, received)


def from_list(
    received: Sequence[int], parts: Sequence[bytes], places: Sequence[int]
) -> Messages:
    """Pack a list of messages."""
    return stored(
        np.array(received, dtype=np.int64),
        np.frombuffer(b''.join(parts), np.uint8),
        np.fromiter(map(len, parts), np.int64, len(parts)),
        np.array(places, dtype=np.int64),
    )


def concatenate(pieces: Sequence[Messages]) -> Messages:
    """Join messages of one topic from several files or chunks, in the order of storage."""
    if not pieces:
        return Messages()
    joined = stored(
        np.concatenate([piece.received for piece in pieces]),
        np.concatenate([piece.blob for piece in pieces]),
        np.concatenate([piece.lengths for piece in pieces]),
        np.concatenate([piece.places for piece in pieces]),
    )
    return joined.sorted_by(joined.places)
