"""Read a few numbers from each message as it comes, without building the message.

The places are found once by walking one message (`motor_sysid.recording.cdr`); every later message
whose deciding bytes are the same (length prefixes, names that were looked up) is read at the same
places, in about 1 us; others are walked anew.  Live nodes and replay read with this same code, so
that both see the same numbers, bit for bit.
"""

from collections.abc import Iterable, Sequence
import math
import struct

from motor_sysid.errors import UserError
from motor_sysid.recording.cdr import find, Layout, TIME
from motor_sysid.recording.definitions import definitions, Types
from motor_sysid.recording.field_path import parse_path
from motor_sysid.recording.messages import Topic

CODES = {
    'u1': 'B', 'i1': 'b', 'u2': 'H', 'i2': 'h', 'u4': 'I', 'i4': 'i', 'u8': 'Q', 'i8': 'q',
    'f4': 'f', 'f8': 'd',
}  # fmt: skip
"""numpy type of a primitive to its `struct` code."""

KEPT = 8
"""Shapes remembered for one topic."""

Number = int | float


class _Plan:
    """Where the wanted numbers lie in messages of one shape."""

    def __init__(self, data: bytes, layouts: Sequence[Layout]) -> None:
        decisive = {byte for layout in layouts for byte in layout.decisive}
        self._decisive = tuple((a, b, data[a:b]) for a, b in _ranges(decisive))
        places = [(x.offset, CODES[x.kind]) if x.kind else None for x in layouts]
        found = sorted({place for place in places if place is not None})
        code, end = '<' if data[1] & 1 else '>', 0
        for offset, kind in found:
            code += f'{offset - end}x{kind}'
            end = offset + struct.calcsize(kind)
        self._struct = struct.Struct(code)
        self._order = tuple(found.index(p) if p is not None else -1 for p in places)
        self._in_order = self._order == tuple(range(len(found)))

    def fits(self, data: bytes) -> bool:
        """Tell whether the message has this shape."""
        return len(data) >= self._struct.size and all(
            data[a:b] == part for a, b, part in self._decisive
        )

    def read(self, data: bytes) -> tuple[Number, ...]:
        values: tuple[Number, ...] = self._struct.unpack_from(data)
        if self._in_order:
            return values
        return tuple(values[k] if k >= 0 else math.nan for k in self._order)


class FieldReader:
    """Reads the numbers at some paths from the messages of one type.

    Parameters
    ----------
    message_type:
        For example ``sensor_msgs/msg/JointState``.
    paths:
        Fields, as in a msg_config file: ``velocity[0]``, ``velocity[name=joint_2]``.
    types:
        Definitions that know the type; default: those of ROS 2 Jazzy.

    Raises
    ------
    UserError
        If the type is not known.
    """

    def __init__(
        self, message_type: str, paths: Sequence[str], types: Types | None = None
    ) -> None:
        self._types = types or definitions([Topic(message_type, message_type)])
        self._type = message_type
        self._steps = tuple(parse_path(path) for path in paths)
        self._plans: list[_Plan] = []

    def read(self, data: bytes) -> tuple[Number, ...]:
        """Return the numbers in the order of the paths, NaN where the message has none.

        Raises
        ------
        UserError
            If the message is cut short, or a path leads to no number.
        """
        for plan in self._plans:
            if plan.fits(data):
                return plan.read(data)
        plan = self._learn(data)
        if not plan.fits(data):
            raise UserError(
                f'a message of {len(data)} bytes is not a whole `{self._type}`; '
                'check the type of the topic'
            )
        self._plans = [plan, *self._plans[: KEPT - 1]]
        return plan.read(data)

    def _learn(self, data: bytes) -> _Plan:
        layouts = [find(data, self._types, self._type, steps) for steps in self._steps]
        for layout, steps in zip(layouts, self._steps, strict=True):
            if layout.kind and layout.kind not in CODES:
                path = '.'.join(step.field for step in steps)
                hint = ' (use its sec and nanosec)' if layout.kind == TIME else ''
                raise UserError(f'`{path}` of `{self._type}` is not a number{hint}')
        return _Plan(data, layouts)


def _ranges(places: Iterable[int]) -> list[tuple[int, int]]:
    """Merge byte numbers into (start, stop) ranges."""
    merged: list[tuple[int, int]] = []
    for place in sorted(places):
        if merged and merged[-1][1] == place:
            merged[-1] = (merged[-1][0], place + 1)
        else:
            merged.append((place, place + 1))
    return merged
