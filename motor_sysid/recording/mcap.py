"""Read MCAP files, whole or broken off, straight into columns.

The file is walked record by record from the start, so a file without its end (a killed recorder, a
full disk) gives every message up to the break; see https://mcap.dev/spec.  Within a chunk the
message index says where each message lies, so nothing is done per message in Python.
"""

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
import mmap
from pathlib import Path
import struct
import zlib

import numpy as np

from motor_sysid.errors import UserError
from motor_sysid.recording.messages import Bytes, concatenate, from_list, Messages, stored, Topic
from motor_sysid.signals.finding import Finding, Severity

MAGIC = b'\x89MCAP0\r\n'
SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX, CHUNK_INDEX, DATA_END = 3, 4, 5, 6, 7, 8, 15
KNOWN = range(1, 128)
MESSAGE_HEAD = struct.Struct('<BQHIQQ')
"""Opcode, length, channel, sequence, log time, publish time; the message follows."""


@dataclass(frozen=True)
class _Record:
    """One record: its opcode and content; `whole` is False where the file ends within it."""

    opcode: int
    content: memoryview
    whole: bool = True


class McapFile:
    """One MCAP file, opened for reading.

    Attributes
    ----------
    topics:
        Its topics.
    findings:
        What is damaged, filled while reading.

    Raises
    ------
    UserError
        If the file is empty or no MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.findings: list[Finding] = []
        self._channels: dict[int, Topic] = {}
        self._schemas: dict[int, tuple[str, str, str]] = {}
        self._break = ''
        self._spoilt: list[str] = []
        self._chunk_starts: list[int] = []
        with path.open('rb') as file:
            if path.stat().st_size == 0:
                raise UserError(f'{path} is empty (0 bytes); nothing was recorded')
            self._data = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
        if bytes(self._data[:8]) != MAGIC:
            raise UserError(f'{path} is not an MCAP file (its first bytes are not MCAP magic)')
        self._knows_topics = self._read_summary()
        if not self._knows_topics:
            for _ in self._regions():
                pass
            self._knows_topics = True

    @property
    def topics(self) -> tuple[Topic, ...]:
        """The topics, each once."""
        return tuple({topic.name: topic for topic in self._channels.values()}.values())

    def read(self, names: Collection[str]) -> dict[str, Messages]:
        """Return the messages of the named topics, in the order in which they were stored."""
        self._break, self._spoilt = '', []
        begin = 0
        pieces: dict[str, list[Messages]] = defaultdict(list)
        for region, index in self._regions():
            found = _indexed(region, index) or _walked(region)
            for channel, messages in found.items():
                topic = self._channels.get(channel)
                if topic and topic.name in names:
                    pieces[topic.name].append(messages.behind(begin))
            begin += len(region)
        self.findings += _damage(self.path.name, self._break, self._spoilt)
        return {name: concatenate(pieces[name]) for name in names if name in pieces}

    def _regions(self) -> 'Iterator[tuple[memoryview, list[memoryview]]]':
        """Yield each stretch of message records with its message index records."""
        region: memoryview | None = None
        index: list[memoryview] = []
        loose_from = -1
        position = reached = 8
        for record, start, position in self._records():
            hole, reached = start > reached, position
            if record.opcode == INDEX:
                index.append(record.content)
                continue
            if region is not None:
                yield region, [] if hole else index
                region, index = None, []
            if record.opcode == MESSAGE and loose_from < 0:
                loose_from = start
            elif record.opcode != MESSAGE and loose_from >= 0:
                yield self._data[loose_from:start], []
                loose_from = -1
            if record.opcode == CHUNK:
                region = self._chunk(record)
            elif record.opcode in {SCHEMA, CHANNEL} and record.whole:
                self._note(record.opcode, record.content)
            elif record.opcode == DATA_END:
                break
        if region is not None:  # the file ends here: its index may be incomplete
            yield region, []
        if loose_from >= 0:
            yield self._data[loose_from:position], []

    def _records(self) -> Iterator[tuple[_Record, int, int]]:
        """Yield top-level records with their start and end; stops where the file breaks off.

        Damage within the file costs what lies before the next chunk that its summary names.
        """
        position, size = 8, len(self._data)
        chunks = iter(sorted(self._chunk_starts))
        ahead = next(chunks, size)
        while position < size:
            while ahead <= position:
                ahead = next(chunks, size)
            if ahead < size and self._end(position) > ahead:
                self._spoilt.append(f'nothing can be read of bytes {position} to {ahead}')
                position = ahead
                continue
            if size - position < 9 or self._data[position] not in KNOWN:
                self._break = f'it breaks off at byte {position} of {size}'
                return
            opcode, length = struct.unpack_from('<BQ', self._data, position)
            end = position + 9 + length
            whole = end <= size
            yield _Record(opcode, self._data[position + 9 : end], whole), position, min(end, size)
            if not whole:
                self._break = f'it breaks off at byte {size} within a record'
                return
            if opcode == DATA_END:
                return
            position = end
        self._break = f'it breaks off at byte {size}, before its index'

    def _end(self, position: int) -> int:
        """Return where the record at a position ends; beyond any file if there is none."""
        opcode, length = struct.unpack_from('<BQ', self._data, position)
        return int(position + 9 + length) if opcode in KNOWN else 1 << 64

    def _chunk(self, record: _Record) -> memoryview | None:
        """Return the records of a chunk, as far as they can be had, and note its channels."""
        content = record.content
        if len(content) < 40:
            return None
        size, crc, name_size = struct.unpack_from('<QII', content, 16)
        compression = bytes(content[32 : 32 + name_size]).decode(errors='replace')
        payload = content[40 + name_size :]
        if not record.whole and compression:
            return None
        region = memoryview(_decompressed(compression, payload)) if compression else payload
        if compression and not region:
            self._spoilt.append('one chunk cannot be decompressed')
            return None
        if record.whole and (len(region) != size or (crc and zlib.crc32(region) != crc)):
            self._spoilt.append('one chunk does not match its checksum')
            return None
        if not self._knows_topics:  # a channel may stand behind messages of others
            for opcode, start, end in _inner(region):
                if opcode in {SCHEMA, CHANNEL}:
                    self._note(opcode, region[start:end])
        return region

    def _note(self, opcode: int, content: memoryview) -> None:
        """Keep a schema or channel record."""
        (key,) = struct.unpack_from('<H', content)
        if opcode == SCHEMA:
            name, encoding, definition = _strings(content, 2, 3)
            self._schemas[key] = (name, encoding, definition)
            return
        (schema,) = struct.unpack_from('<H', content, 2)
        topic, serialization = _strings(content, 4, 2)
        metadata = _mapping(content, 12 + len(topic.encode()) + len(serialization.encode()))
        name, encoding, definition = self._schemas.get(schema, ('', '', ''))
        self._channels[key] = Topic(
            topic, name, definition, encoding, metadata.get('topic_type_hash', ''),
            metadata.get('offered_qos_profiles', ''), serialization,
        )  # fmt: skip

    def _read_summary(self) -> bool:
        """Take topics and chunks from the summary at the end of a file that was closed."""
        size = len(self._data)
        if size < 45 or bytes(self._data[-8:]) != MAGIC:
            return False
        (start,) = struct.unpack_from('<Q', self._data, size - 28)
        if not 8 < start < size:
            return False
        for opcode, first, last in _inner(self._data[start : size - 37]):
            content = self._data[start + first : start + last]
            if opcode in {SCHEMA, CHANNEL}:
                self._note(opcode, content)
            elif opcode == CHUNK_INDEX and len(content) >= 24:
                (first,) = struct.unpack_from('<Q', content, 16)
                if first < size - 9 and self._data[first] == CHUNK and self._end(first) < size:
                    self._chunk_starts.append(first)
        return bool(self._channels)


def _inner(region: memoryview) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, start and end of the content of each whole record in a region."""
    position, size = 0, len(region)
    while size - position >= 9:
        opcode, length = struct.unpack_from('<BQ', region, position)
        start = position + 9
        position = start + length
        if position > size or opcode not in KNOWN:
            return
        yield opcode, start, position


def _indexed(region: memoryview, index: list[memoryview]) -> Mapping[int, Messages]:
    """Messages by channel through the message index; empty if there is none or it is wrong."""
    data = np.frombuffer(region, np.uint8)
    found: dict[int, Messages] = {}
    for content in index:
        channel, _ = struct.unpack_from('<HI', content)
        pairs = np.frombuffer(content[6 : 6 + (len(content) - 6) // 16 * 16], '<u8')
        starts = np.sort(pairs[1::2].astype(np.int64))
        if starts.size == 0:
            continue
        if starts[0] < 0 or starts[-1] + 31 > data.size:
            return {}
        heads = data[starts[:, None] + np.arange(31)]
        sizes = heads[:, 1:9].copy().view('<u8').ravel().astype(np.int64)
        if np.any(heads[:, 0] != MESSAGE) or np.any(starts + 9 + sizes > data.size):
            return {}
        logged = heads[:, 15:23].copy().view('<u8').ravel().astype(np.int64)
        blob = _gather(data, starts + 31, sizes - 22)
        found[channel] = stored(logged, blob, sizes - 22, starts)
    return found


def _gather(data: Bytes, starts: np.ndarray, lengths: np.ndarray) -> Bytes:
    """Copy the bytes at `starts` with the given `lengths` one after the other."""
    if np.all(lengths == lengths[0]):
        rows: Bytes = data[starts[:, None] + np.arange(int(lengths[0]))].ravel()
        return rows
    parts = [data[a : a + n] for a, n in zip(starts.tolist(), lengths.tolist(), strict=True)]
    return np.concatenate(parts)


def _walked(region: memoryview) -> Mapping[int, Messages]:
    """Messages by channel, found by walking a region that has no index."""
    logged: dict[int, list[int]] = defaultdict(list)
    parts: dict[int, list[bytes]] = defaultdict(list)
    places: dict[int, list[int]] = defaultdict(list)
    for opcode, start, end in _inner(region):
        if opcode == MESSAGE and end - start >= 22:
            _, _, channel, _, log_time, _ = MESSAGE_HEAD.unpack_from(region, start - 9)
            logged[channel].append(log_time)
            parts[channel].append(bytes(region[start + 22 : end]))
            places[channel].append(start)
    return {key: from_list(logged[key], parts[key], places[key]) for key in logged}


def _decompressed(compression: str, payload: memoryview) -> bytes:
    """Return the decompressed bytes, none if they are damaged."""
    # rosbags carries the decompressors (lz4, zstd) for every Python version.
    from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

    if compression not in DECOMPRESSORS:
        raise UserError(f'MCAP chunk compression `{compression}` is not known; use lz4 or zstd')
    try:
        return DECOMPRESSORS[compression](bytes(payload), 0)
    except Exception:  # noqa: BLE001 - every library has its own error
        return b''


def _strings(content: memoryview, position: int, count: int) -> list[str]:
    """Read `count` length-prefixed strings."""
    texts = []
    for _ in range(count):
        (length,) = struct.unpack_from('<I', content, position)
        position += 4
        texts.append(bytes(content[position : position + length]).decode(errors='replace'))
        position += length
    return texts


def _mapping(content: memoryview, position: int) -> dict[str, str]:
    """Read a length-prefixed map of strings."""
    (length,) = struct.unpack_from('<I', content, position)
    position, end = position + 4, position + 4 + length
    found = {}
    while position < end:
        key, value = _strings(content, position, 2)
        found[key] = value
        position += 8 + len(key.encode()) + len(value.encode())
    return found


def _damage(name: str, broken_off: str, spoilt: Sequence[str]) -> list[Finding]:
    """Return the findings: where the file breaks off, and what cannot be read before that."""
    found = []
    if broken_off:
        found.append(
            Finding(
                Severity.WARNING, 'damaged_bag', f'{name} is damaged: {broken_off}',
                'everything before the damage was read; what came after it is lost',
                'close the recorder with Ctrl-C and wait for it; sqlite3 storage survives a kill',
            )
        )  # fmt: skip
    if spoilt:
        more = f' (and at {len(spoilt) - 1} other places)' if len(spoilt) > 1 else ''
        found.append(
            Finding(
                Severity.WARNING, 'damaged_bag', f'{name} is damaged: {spoilt[0]}{more}',
                'the messages there are lost; all others were read',
                'copy the bag again from its source', {'places': len(spoilt)},
            )
        )  # fmt: skip
    return found
