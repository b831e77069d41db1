"""Message definitions of installed packages, from their Python classes."""

from functools import cache
import re

from rosbags.typesys import get_typestore, Stores

from motor_sysid.errors import UserError
from motor_sysid.nodes.intake import message_class
from motor_sysid.recording.definitions import Field, Shape, Types

PRIMITIVES = {
    'boolean': 'bool', 'octet': 'byte', 'float': 'float32', 'double': 'float64',
    'string': 'string', 'wstring': 'wstring',
    **{f'{sign}int{bits}': f'{sign}int{bits}' for sign in ('', 'u') for bits in (8, 16, 32, 64)},
}  # fmt: skip
"""Primitive as the class names it to its name in a definition."""

SEQUENCE = re.compile(r'sequence<(.+?)(?:, (\d+))?>')
ARRAY = re.compile(r'(.+)\[(\d+)\]')
BOUNDED = re.compile(r'<\d+>')


def installed_types(message_type: str) -> Types:
    """Return the definition of an installed message type and of all that it contains.

    Raises
    ------
    UserError
        If it is not installed, or has a field that cannot be read.
    """
    types: Types = {}
    waiting = [message_type]
    while waiting:
        name = waiting.pop()
        if name in types or name in PRIMITIVES.values():
            continue
        described = message_class(name).get_fields_and_field_types()
        types[name] = tuple(_field(field, text) for field, text in described.items())
        waiting += [field.kind for field in types[name]]
    return types


def own_definition(message_type: str) -> str | None:
    """Return the text of an installed type and of all that it contains, as bags hold it.

    None for a type of ROS 2 Jazzy, whose text, with its constants, the writer of the bag knows.

    Raises
    ------
    UserError
        See `installed_types`.
    """
    if message_type in _shipped():
        return None
    parts = (_text(name, fields) for name, fields in installed_types(message_type).items())
    return f'{"=" * 80}\n'.join(parts).partition('\n')[2]


@cache
def _shipped() -> frozenset[str]:
    """Return the types that ROS 2 Jazzy ships."""
    return frozenset(get_typestore(Stores.ROS2_JAZZY).fielddefs)


def _text(name: str, fields: tuple[Field, ...]) -> str:
    """Return the title of a type, and a line for each of its fields."""
    ends = {Shape.ONE: '', Shape.SEQUENCE: '[]'}
    lines = (f'{f.kind}{ends.get(f.shape, f"[{f.count}]")} {f.name}' for f in fields)
    return '\n'.join([f'MSG: {name}', *lines, '']).replace('/msg/', '/')


def _field(name: str, text: str) -> Field:
    if match := SEQUENCE.fullmatch(text):
        return Field(name, _kind(match[1]), Shape.SEQUENCE, 0)
    if match := ARRAY.fullmatch(text):
        return Field(name, _kind(match[1]), Shape.ARRAY, int(match[2]))
    return Field(name, _kind(text))


def _kind(text: str) -> str:
    plain = BOUNDED.sub('', text)
    if plain in PRIMITIVES:
        return PRIMITIVES[plain]
    package, _, name = plain.partition('/')
    if not name:
        raise UserError(f'fields of type `{text}` are not understood')
    return f'{package}/msg/{name}'
