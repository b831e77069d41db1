"""Message definitions of installed packages, from their Python classes."""

import re

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
