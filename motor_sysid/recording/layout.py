"""Where the numbers lie in a CDR message: read a few fields without building the message.

Messages of one topic nearly always have one shape (the same strings and array lengths), so the
offsets are found once by walking one message by its definition; every later message is compared
with that shape byte by byte, numbers and padding left out, and then read at fixed offsets in
about 1 us.  A message of another shape is walked anew.  Live nodes and replay read with this same
code, so that both see the same numbers, bit for bit.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
import math
import struct
from typing import cast

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc
from rosbags.typesys import get_typestore, Stores
from rosbags.typesys.store import Typestore

from motor_sysid.errors import UserError

CODES = {
    'bool': '?', 'byte': 'B', 'char': 'B', 'octet': 'B', 'uint8': 'B', 'int8': 'b',
    'uint16': 'H', 'int16': 'h', 'uint32': 'I', 'int32': 'i', 'uint64': 'Q', 'int64': 'q',
    'float32': 'f', 'float64': 'd',
}  # fmt: skip
"""Primitive type of a message definition to its `struct` code."""

ENCAPSULATION = 4
"""Bytes in front of the content; alignment counts from there."""

KEPT = 8
"""Shapes remembered for one topic."""

Value = int | float


@dataclass
class Shape:
    """Every number, string and array of one message, with its place.

    Attributes
    ----------
    order:
        ``<`` or ``>``, from the encapsulation header.
    numbers:
        Path to (offset in bytes, `struct` code, count); count is None for a single number.
    strings:
        Path to text.
    fixed:
        Ranges of bytes that make the shape: header, lengths and strings.
    """

    order: str
    numbers: dict[str, tuple[int, str, int | None]] = field(default_factory=dict)
    strings: dict[str, str] = field(default_factory=dict)
    fixed: list[tuple[int, int]] = field(default_factory=list)

    def find(self, path: str) -> tuple[int, str] | None:
        """Return (offset, code) of a number, or None where this message does not have it.

        ``velocity[0]`` is an element; ``velocity[left]`` is the element whose ``name`` is left.
        """
        if path in self.numbers:
            offset, code, count = self.numbers[path]
            return (offset, code) if count is None else None
        base, _, index = path.removesuffix(']').rpartition('[')
        offset, code, count = self.numbers.get(base, (0, 'd', 0))
        k = self._index(index)
        if count is None or not 0 <= k < count:
            return None
        return offset + k * struct.calcsize(code), code

    def _index(self, index: str) -> int:
        if index.isdecimal():
            return int(index)
        names = [text for path, text in self.strings.items() if path.startswith('name[')]
        return names.index(index) if index in names else -1


def walk(typestore: Typestore, message_type: str, raw: bytes) -> Shape:
    """Return the shape of one CDR message.

    Raises
    ------
    UserError
        If the message is cut short or its definition is not the given type's.
    """
    shape = Shape('<' if raw[1] & 1 else '>')
    shape.fixed.append((0, ENCAPSULATION))
    try:
        _struct(typestore, message_type, raw, shape, '', ENCAPSULATION)
    except (struct.error, IndexError, UnicodeDecodeError) as error:
        raise UserError(
            f'a message of {len(raw)} bytes is not a whole `{message_type}` ({error}); '
            'check the type of the topic'
        ) from None
    return shape


def _aligned(offset: int, size: int) -> int:
    return offset + (ENCAPSULATION - offset) % size


def _struct(
    typestore: Typestore, name: str, raw: bytes, shape: Shape, prefix: str, offset: int
) -> int:
    for member, description in typestore.get_msgdef(name).fields:
        path = f'{prefix}.{member}' if prefix else member
        offset = _member(typestore, description, raw, shape, path, offset)
    return offset


def _member(
    typestore: Typestore, description: FieldDesc, raw: bytes, shape: Shape, path: str, offset: int
) -> int:
    kind, details = description
    if kind == Nodetype.NAME:
        return _struct(typestore, str(details), raw, shape, path, offset)
    if kind == Nodetype.BASE:
        return _primitive(str(details[0]), raw, shape, path, offset)
    element, count = cast(tuple[FieldDesc, int], details)
    if kind == Nodetype.SEQUENCE:
        count, offset = _length(raw, shape, offset)
    return _elements(typestore, element, count, raw, shape, path, offset)


def _elements(
    typestore: Typestore, element: FieldDesc, count: int, raw: bytes, shape: Shape, path: str,
    offset: int,
) -> int:  # fmt: skip
    kind, details = element
    if kind == Nodetype.BASE and details[0] in CODES:
        return _numbers(CODES[str(details[0])], count, raw, shape, path, offset)
    for k in range(count):
        offset = _member(typestore, element, raw, shape, f'{path}[{k}]', offset)
    return offset


def _numbers(code: str, count: int, raw: bytes, shape: Shape, path: str, offset: int) -> int:
    size = struct.calcsize(code)
    if count:
        offset = _aligned(offset, size)
    shape.numbers[path] = (offset, code, count)
    end = offset + count * size
    if end > len(raw):
        raise IndexError(f'`{path}` ends at byte {end}')
    return end


def _primitive(name: str, raw: bytes, shape: Shape, path: str, offset: int) -> int:
    if name in CODES:
        size = struct.calcsize(CODES[name])
        start = _aligned(offset, size)
        if start + size > len(raw):
            raise IndexError(f'`{path}` ends at byte {start + size}')
        shape.numbers[path] = (start, CODES[name], None)
        return start + size
    if name != 'string':
        raise UserError(f'`{path}` is a {name}, which is not supported')
    length, start = _length(raw, shape, offset)
    shape.strings[path] = raw[start : start + max(length - 1, 0)].decode()
    shape.fixed.append((start, start + length))
    if start + length > len(raw):
        raise IndexError(f'`{path}` ends at byte {start + length}')
    return start + length


def _length(raw: bytes, shape: Shape, offset: int) -> tuple[int, int]:
    start = _aligned(offset, 4)
    shape.fixed.append((start, start + 4))
    return struct.unpack_from(f'{shape.order}I', raw, start)[0], start + 4


class _Plan:
    """How to read the wanted numbers from messages of one shape."""

    def __init__(self, shape: Shape, paths: Sequence[str], raw: bytes) -> None:
        self._fixed = tuple((a, b, raw[a:b]) for a, b in _merged(shape.fixed))
        places = [shape.find(path) for path in paths]
        found = sorted({place for place in places if place is not None})
        layout, end = shape.order, 0
        for offset, code in found:
            layout += f'{offset - end}x{code}'
            end = offset + struct.calcsize(code)
        self._struct = struct.Struct(layout)
        self._order = tuple(found.index(p) if p is not None else -1 for p in places)
        self._in_order = self._order == tuple(range(len(found)))

    def matches(self, raw: bytes) -> bool:
        """Tell whether the message has this shape."""
        return len(raw) >= self._struct.size and all(
            raw[a:b] == fixed for a, b, fixed in self._fixed
        )

    def read(self, raw: bytes) -> tuple[Value, ...]:
        """Return the numbers in the order of the paths, NaN where the message has none."""
        values: tuple[Value, ...] = self._struct.unpack_from(raw)
        if self._in_order:
            return values
        return tuple(values[k] if k >= 0 else math.nan for k in self._order)


def _merged(ranges: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    merged: list[tuple[int, int]] = []
    for start, stop in sorted(ranges):
        if merged and merged[-1][1] == start:
            merged[-1] = (merged[-1][0], stop)
        else:
            merged.append((start, stop))
    return merged


class FieldReader:
    """Reads named numbers from the CDR messages of one type.

    Parameters
    ----------
    message_type:
        For example ``sensor_msgs/msg/JointState``.
    paths:
        For example ``('header.stamp.sec', 'velocity[0]', 'velocity[left]')``.
    typestore:
        Knows the type; default: the types of ROS 2 Jazzy.
    """

    def __init__(
        self, message_type: str, paths: Sequence[str], typestore: Typestore | None = None
    ) -> None:
        self._typestore = typestore or get_typestore(Stores.ROS2_JAZZY)
        self._type = message_type
        self._paths = tuple(paths)
        self._plans: list[_Plan] = []

    def read(self, raw: bytes) -> tuple[Value, ...]:
        """Return the numbers in the order of the paths, NaN where the message has none."""
        for plan in self._plans:
            if plan.matches(raw):
                return plan.read(raw)
        plan = _Plan(walk(self._typestore, self._type, raw), self._paths, raw)
        self._plans = [plan, *self._plans[: KEPT - 1]]
        return plan.read(raw)
