"""Message definitions: those stored in a bag first, those of ROS 2 Jazzy else."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from enum import Enum

from motor_sysid.errors import UserError
from motor_sysid.recording.messages import Topic


class Shape(Enum):
    """How a field holds its value: once, a fixed number of times, or counted."""

    ONE = 'one'
    ARRAY = 'array'
    SEQUENCE = 'sequence'


@dataclass(frozen=True)
class Field:
    """One field of a message.

    Attributes
    ----------
    name:
        Field name.
    kind:
        A primitive (``float64``, ``string`` ...) or a message type (``std_msgs/msg/Header``).
    shape, count:
        One value, an array of `count`, or a sequence.
    """

    name: str
    kind: str
    shape: Shape = Shape.ONE
    count: int = 1


Types = dict[str, tuple[Field, ...]]
"""Message type to its fields."""


def definitions(topics: Iterable[Topic]) -> Types:
    """Return the types of the topics with everything they are made of.

    Raises
    ------
    UserError
        If a definition cannot be parsed, or a type is neither stored in the bag nor part of
        ROS 2 Jazzy.
    """
    types: Types = {}
    for topic in topics:
        if topic.msgtype in types:
            continue
        if topic.definition:
            types |= _parsed(topic)
        if not _complete(topic.msgtype, types):
            types = _jazzy() | types
        if not _complete(topic.msgtype, types):
            raise UserError(
                f'topic `{topic.name}` has type `{topic.msgtype}`, which the bag does not define '
                'and ROS 2 Jazzy does not ship; record with mcap storage, which stores definitions'
            )
    return types


def _complete(name: str, types: Types) -> bool:
    """Tell whether a type and all that it contains are known."""
    if name not in types:
        return False
    return all('/' not in field.kind or _complete(field.kind, types) for field in types[name])


def _parsed(topic: Topic) -> Types:
    from rosbags.typesys import get_types_from_idl, get_types_from_msg, TypesysError

    try:
        if topic.encoding == 'ros2idl' or topic.definition.startswith('=' * 80 + '\nIDL'):
            found: Types = {}
            for part in topic.definition.split('=' * 80 + '\n'):
                found |= _fields(get_types_from_idl(part.partition('\n')[2])) if part else {}
            return found
        return _fields(get_types_from_msg(topic.definition, topic.msgtype))
    except TypesysError as error:
        raise UserError(
            f'the definition of `{topic.msgtype}` in the bag cannot be read: '
            f'{str(error).splitlines()[0]}'
        ) from None


def _jazzy() -> Types:
    from rosbags.typesys import get_typestore, Stores

    return _fields(get_typestore(Stores.ROS2_JAZZY).fielddefs)


def _fields(table: object) -> Types:
    """Translate the tables of rosbags, which are nested tuples keyed by node type."""
    from rosbags.interfaces import Nodetype

    def one(name: str, description: tuple[Nodetype, tuple[object, int]]) -> Field:
        node, content = description
        if node == Nodetype.BASE:
            return Field(name, str(content[0]))
        if node == Nodetype.NAME:
            return Field(name, str(content))
        inner = one(name, content[0])  # type: ignore[arg-type]
        shape = Shape.ARRAY if node == Nodetype.ARRAY else Shape.SEQUENCE
        return Field(name, inner.kind, shape, content[1])

    assert isinstance(table, dict)
    return {
        name: tuple(one(field, description) for field, description in fields)
        for name, (_, fields) in table.items()
    }


def field_names(types: Types, msgtype: str) -> Collection[str]:
    """Return the names of the fields of a type, for messages to people."""
    return [field.name for field in types.get(msgtype, ())]
