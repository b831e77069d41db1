"""Columns out of CDR messages without deserialising each of them.

One message is walked to find where a value lies and which length prefixes decide that.  Every
message of the same size with the same prefixes has it in the same place, so the column is one
strided copy; messages that differ are walked again, group by group.
"""

from dataclasses import dataclass, field
import struct

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.recording.definitions import Field, field_names, Shape, Types
from motor_sysid.recording.field_path import parse_path, Step
from motor_sysid.recording.messages import Bytes, Messages
from motor_sysid.signals.units import did_you_mean

PRIMITIVES = {
    'bool': 'u1', 'byte': 'u1', 'char': 'u1', 'uint8': 'u1', 'int8': 'i1',
    'uint16': 'u2', 'int16': 'i2', 'uint32': 'u4', 'int32': 'i4',
    'uint64': 'u8', 'int64': 'i8', 'float32': 'f4', 'float64': 'f8',
}  # fmt: skip
TIME = 'builtin_interfaces/msg/Time'
HEADER = 4
"""Bytes in front of the data of every message: the encapsulation."""


@dataclass
class Layout:
    """Where one value lies in a message.

    Attributes
    ----------
    kind:
        numpy type without byte order, or `TIME`; empty where the value is absent (an empty or too
        short array, or a name that is not listed).
    offset:
        Byte of the value.
    decisive:
        Bytes that decide it: length prefixes and names that were compared.
    """

    kind: str = ''
    offset: int = -1
    decisive: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class Column:
    """One field of all messages.

    Attributes
    ----------
    values:
        (N,), integers as int64; times in ns.
    present:
        (N,) whether the message has the field.
    is_time:
        Whether it is a time.
    """

    values: NDArray[np.float64] | NDArray[np.int64]
    present: NDArray[np.bool_]
    is_time: bool


def column(messages: Messages, types: Types, msgtype: str, path: str) -> Column:
    """Take one field out of all messages.

    Raises
    ------
    UserError
        If the type has no such field, the field is no number or time, or no message can be read.
    """
    steps = parse_path(path)
    kind = _kind_of(types, msgtype, steps, path)
    values: NDArray[np.float64] | NDArray[np.int64] = np.zeros(len(messages), dtype=np.float64)
    if kind == TIME or PRIMITIVES[kind][0] in 'iu':
        values = np.zeros(len(messages), dtype=np.int64)
    unreadable = ''
    present = np.zeros(len(messages), dtype=bool)
    for rows, data in messages.groups():
        rest = np.arange(len(rows))
        while rest.size:
            try:
                layout = find(data[rest[0]].tobytes(), types, msgtype, steps)
            except UserError as error:  # a damaged message is as good as none
                unreadable, rest = str(error), rest[1:]
                continue
            decisive = np.array(layout.decisive, dtype=np.intp)
            first = data[rest[0], decisive]
            same = np.all(data[np.ix_(rest, decisive)] == first, axis=1)
            chosen, rest = rest[same], rest[~same]
            if layout.kind:
                values[rows[chosen]] = _take(data, chosen, layout)
                present[rows[chosen]] = True
    if unreadable and not np.any(present):
        raise UserError(f'`{path}` cannot be read from `{msgtype}`: {unreadable}')
    return Column(values, present, kind == TIME)


def find(data: bytes, types: Types, msgtype: str, steps: tuple[Step, ...]) -> Layout:
    """Return where the value of a path lies in one message.

    Raises
    ------
    UserError
        If the message ends before the value does.
    """
    walk = _Walk(data, types)
    try:
        kind = walk.locate(msgtype, steps)
        size = {TIME: 8, 'string': 4}.get(kind) or (int(kind[1]) if kind else 0)
        if walk.position + size > len(data):
            raise _ShortError
    except _ShortError:
        raise UserError(
            f'a message of {len(data)} bytes is not a whole `{msgtype}`; check the type of the '
            'topic, or whether the bag is damaged'
        ) from None
    return Layout(kind, walk.position, walk.decisive)


def text_of(data: bytes, types: Types, msgtype: str, path: str) -> str:
    """Return a string field of one message (empty if it is absent)."""
    walk = _Walk(data, types)
    try:
        return walk.string() if walk.locate(msgtype, parse_path(path)) == 'string' else ''
    except _ShortError:
        return ''


def strings_of(data: bytes, types: Types, msgtype: str, name: str) -> list[str]:
    """Return an array of strings that stands directly in the message (empty if it is absent)."""
    try:
        return _Walk(data, types).strings(msgtype, name)
    except _ShortError:
        return []


class _ShortError(Exception):
    """A message ends before its fields do."""


class _Walk:
    """A cursor over one CDR message; counts as it skips, and remembers what decided its way."""

    def __init__(self, data: bytes, types: Types) -> None:
        self.data = data
        self.types = types
        self.position = HEADER
        self.decisive: list[int] = [1]
        self.order = '<' if len(data) > 1 and data[1] & 1 else '>'

    def locate(self, msgtype: str, steps: tuple[Step, ...]) -> str:
        """Move to the value; returns its kind, empty if it is absent."""
        step, start = steps[0], self.position
        wanted = next((f for f in self.types[msgtype] if f.name == step.field), None)
        if wanted is None:
            return ''
        for other in self.types[msgtype]:
            if other.name == step.field:
                break
            self.skip(other)
        if not self._enter(wanted, step, msgtype, start):
            return ''
        if len(steps) > 1:
            return self.locate(wanted.kind, steps[1:])
        if wanted.kind in PRIMITIVES:
            self.align(int(PRIMITIVES[wanted.kind][1]))
        elif wanted.kind == TIME:
            self.align(4)
        return PRIMITIVES.get(wanted.kind, wanted.kind)

    def _enter(self, wanted: Field, step: Step, msgtype: str, start: int) -> bool:
        """Move from the field to the element that is meant; False if there is none."""
        if not step.indexed:
            return wanted.shape is Shape.ONE
        index = step.index
        if index is None:
            other = _Walk(self.data, self.types)
            other.position = start
            names = other.strings(msgtype, step.key)
            self.decisive += other.decisive
            index = names.index(step.text) if step.text in names else -1
        count = wanted.count if wanted.shape is Shape.ARRAY else self.length()
        if not 0 <= index < count:
            return False
        self._skip_elements(wanted.kind, index)
        return True

    def strings(self, msgtype: str, name: str) -> list[str]:
        """Return the array of strings called `name` in the struct at the cursor."""
        for entry in self.types[msgtype]:
            if entry.name == name and entry.kind == 'string' and entry.shape is not Shape.ONE:
                count = entry.count if entry.shape is Shape.ARRAY else self.length()
                return [self.string() for _ in range(count)]
            self.skip(entry)
        return []

    def align(self, size: int) -> None:
        """Move to the next multiple of `size`, counted from behind the encapsulation."""
        self.position += -(self.position - HEADER) % size

    def length(self) -> int:
        """Read a length prefix."""
        self.align(4)
        if self.position + 4 > len(self.data):
            raise _ShortError
        (count,) = struct.unpack_from(f'{self.order}I', self.data, self.position)
        self.decisive += range(self.position, self.position + 4)
        self.position += 4
        return int(count)

    def string(self) -> str:
        """Read a string, which ends with a zero byte."""
        size = self.length()
        text = self.data[self.position : self.position + size]
        self.decisive += range(self.position, min(self.position + size, len(self.data)))
        self.position += size
        return text.rstrip(b'\0').decode(errors='replace')

    def skip(self, entry: Field) -> None:
        """Move behind a field."""
        count = entry.count
        if entry.shape is Shape.SEQUENCE:
            count = self.length()
        self._skip_elements(entry.kind, count if entry.shape is not Shape.ONE else 1)

    def _skip_elements(self, kind: str, count: int) -> None:
        if kind in PRIMITIVES:
            size = int(PRIMITIVES[kind][1])
            if count:
                self.align(size)
                self.position += size * count
            return
        for _ in range(count):
            if kind == 'string':
                size = self.length()
                self.position += size
            elif kind not in self.types:
                raise UserError(f'fields of type `{kind}` are not understood')
            elif not self.types[kind]:
                self.position += 1  # an empty struct is one byte on the wire
            for entry in self.types.get(kind, ()):
                self.skip(entry)


def _take(data: Bytes, rows: NDArray[np.intp], layout: Layout) -> NDArray[np.generic]:
    """Copy the value at a layout out of (n, length) bytes."""
    order = '<' if data[rows[0], 1] & 1 else '>'

    def cut(start: int, code: str) -> NDArray[np.generic]:
        piece = data[rows, start : start + int(code[1])]
        return np.ascontiguousarray(piece).view(order + code).ravel()

    if layout.kind != TIME:
        return cut(layout.offset, layout.kind)
    seconds = cut(layout.offset, 'i4').astype(np.int64)
    return seconds * 1_000_000_000 + cut(layout.offset + 4, 'u4').astype(np.int64)


def _kind_of(types: Types, msgtype: str, steps: tuple[Step, ...], path: str) -> str:
    """Check a path against the type; returns the kind of its value, a primitive or a time."""
    kind = msgtype
    for step in steps:
        entry = next((f for f in types.get(kind, ()) if f.name == step.field), None)
        if entry is None:
            known = field_names(types, kind)
            raise UserError(
                f'`{kind}` has no field `{step.field}` (path `{path}`)'
                f'{did_you_mean(step.field, known)}; it has {", ".join(known) or "none"}'
            )
        if (entry.shape is Shape.ONE) == step.indexed:
            form = f'{step.field}[0]' if not step.indexed else step.field
            raise UserError(f'`{step.field}` of `{kind}` is addressed as `{form}` (path `{path}`)')
        if step.key and step.key not in field_names(types, kind):
            raise UserError(f'`{kind}` has no field `{step.key}` to look up names (path `{path}`)')
        kind = entry.kind
    if kind != TIME and kind not in PRIMITIVES:
        raise UserError(f'`{path}` is a {kind}, not a number; name one of its fields')
    return kind
