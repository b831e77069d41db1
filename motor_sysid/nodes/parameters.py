"""Node parameters from one frozen dataclass: sentence, unit and range of each in one place."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, Field, field, fields, replace
import difflib
import math
import os
from pathlib import Path
import textwrap
from typing import Any, cast, Generic, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from motor_sysid.errors import UserError

T = TypeVar('T')
Value = bool | int | float | str | tuple[str, ...]

OURS_NOT = ('use_sim_time', 'start_type_description_service', 'qos_overrides.')
"""Parameters that rclpy declares itself."""


@dataclass(frozen=True)
class Spec:
    """What is known of one parameter besides its default.

    Attributes
    ----------
    sentence:
        What it does.
    unit:
        SI unit; empty for what has none.
    low, high:
        Range of a number, inclusive.
    choices:
        Allowed texts.
    live:
        Whether it may be changed while the node runs.
    """

    sentence: str
    unit: str = ''
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    live: bool = False

    def range_text(self) -> str:
        """Return the range in words."""
        if self.choices:
            return 'one of ' + ', '.join(self.choices)
        if self.low is None or self.high is None:
            return ''
        return f'{self.low:g} to {self.high:g} {self.unit}'.strip()


def parameter(
    default: T,
    sentence: str,
    unit: str = '',
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    live: bool = False,
) -> T:
    """Declare one field of a settings dataclass as a parameter; see `Spec`."""
    spec = Spec(sentence, unit, low, high, choices, live)
    made: T = field(default=default, metadata={'spec': spec})
    return made


def spec_of(item: 'Field[Any]') -> Spec:
    """Return what is known of a field made by `parameter`."""
    spec: Spec = item.metadata['spec']
    return spec


def checked(item: 'Field[Any]', given: object) -> Value:
    """Return a given value in the type of the field's default.

    Raises
    ------
    UserError
        If the type, the range or the choice is wrong.
    """
    spec, default = spec_of(item), item.default
    value = _converted(item.name, given, default)
    if spec.choices and value not in spec.choices:
        hint = _hint(str(value), spec.choices)
        raise UserError(f'`{item.name}` = {value!r} is not {spec.range_text()}{hint}')
    if isinstance(value, float | int) and not isinstance(value, bool):
        low = -math.inf if spec.low is None else spec.low
        high = math.inf if spec.high is None else spec.high
        if not (math.isfinite(value) and low <= value <= high):
            raise UserError(
                f'`{item.name}` = {value:g} {spec.unit} is outside its range {spec.range_text()}'
            )
    return value


def _converted(name: str, given: object, default: object) -> Value:
    if isinstance(default, tuple):
        if isinstance(given, str):
            given = given.split(',')
        if isinstance(given, list | tuple) and all(isinstance(text, str) for text in given):
            return tuple(text.strip() for text in given if text.strip())
        raise UserError(f'`{name}` = {given!r} must be a list of texts')
    if isinstance(default, float) and isinstance(given, int) and not isinstance(given, bool):
        return float(given)
    if type(given) is not type(default):
        raise UserError(
            f'`{name}` = {given!r} is a {type(given).__name__}; it must be a '
            f'{type(default).__name__}'
        )
    return cast(Value, given)


def as_path(text: str) -> Path:
    """Return the path that a parameter names; no shell has put the home in the place of its ~."""
    return Path(os.path.expanduser(text))


def _hint(name: str, known: tuple[str, ...] | list[str]) -> str:
    close = difflib.get_close_matches(name, known, 1)
    return f'; did you mean `{close[0]}`?' if close else ''


class Settings(Generic[T]):
    """The parameters of a node as one value, kept up to date.

    Parameters
    ----------
    node:
        Made with ``automatically_declare_parameters_from_overrides=True``, so that names that
        were given but are not known can be told from the others.
    kind:
        Frozen dataclass whose fields were made by `parameter`.

    Raises
    ------
    UserError
        If an unknown parameter was given, or a value is of the wrong type or out of range.
    """

    def __init__(self, node: Node, kind: type[T]) -> None:
        self._node = node
        self._fields = {item.name: item for item in fields(cast(Any, kind))}
        self._changed: list[Callable[[T], None]] = []
        self._tests: list[Callable[[T], None]] = []
        given = self._given()
        self.value: T = kind(
            **{name: checked(self._fields[name], value) for name, value in given.items()}
        )
        for item in self._fields.values():
            self._declare(item, item.name in given)
        node.add_pre_set_parameters_callback(self._convert)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._take)

    def on_change(self, callback: Callable[[T], None]) -> None:
        """Have `callback` called with the new settings after each change."""
        self._changed.append(callback)

    def test_change(self, test: Callable[[T], None]) -> None:
        """Have `test` called with new settings before they are taken; it may refuse them."""
        self._tests.append(test)

    def _given(self) -> Mapping[str, object]:
        given: dict[str, object] = {}
        for name in self._node.get_parameters_by_prefix(''):
            if name in self._fields:
                given[name] = self._node.get_parameter(name).value
            elif name == 'use_sim_time':
                _converted(name, self._node.get_parameter(name).value, False)
            elif not name.startswith(OURS_NOT):
                hint = _hint(name, list(self._fields))
                known = ', '.join(self._fields)
                raise UserError(f'unknown parameter `{name}`{hint} (known: {known})')
        return given

    def _declare(self, item: 'Field[Any]', given: bool) -> None:
        if given:
            self._node.undeclare_parameter(item.name)
        value = getattr(self.value, item.name)
        self._node.declare_parameter(
            item.name, _to_ros(value), _descriptor(item), ignore_override=True
        )

    def _convert(self, parameters: list[Parameter]) -> list[Parameter]:
        """Turn an int into a float where a float is meant, and a text into a list."""
        return [self._converted(p) for p in parameters]

    def _converted(self, given: Parameter) -> Parameter:
        item = self._fields.get(given.name)
        if item is None:
            return given
        try:
            return Parameter(given.name, value=_to_ros(_converted('', given.value, item.default)))
        except UserError:
            return given

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            value = self._with(parameters)
            for test in self._tests if value != self.value else ():
                test(value)
        except UserError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _with(self, parameters: list[Parameter]) -> T:
        changes = {
            p.name: checked(self._fields[p.name], p.value)
            for p in parameters
            if p.name in self._fields
        }
        return replace(cast(Any, self.value), **changes) if changes else self.value

    def _take(self, parameters: list[Parameter]) -> None:
        value = self._with(parameters)
        if value != self.value:
            self.value = value
            for callback in self._changed:
                callback(value)


def _to_ros(value: Value) -> bool | int | float | str | list[str]:
    """Return the value as ROS carries it; an empty list has no type there, so it is ``['']``."""
    if isinstance(value, tuple):
        return list(value) or ['']
    return value


def _descriptor(item: 'Field[Any]') -> ParameterDescriptor:
    spec = spec_of(item)
    descriptor = ParameterDescriptor(
        description=f'{spec.sentence} [{spec.unit}]' if spec.unit else spec.sentence,
        additional_constraints=spec.range_text(),
        read_only=not spec.live,
    )
    if spec.low is not None and spec.high is not None:
        if isinstance(item.default, float):
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=float(spec.low), to_value=float(spec.high))
            ]
        else:
            descriptor.integer_range = [
                IntegerRange(from_value=int(spec.low), to_value=int(spec.high), step=1)
            ]
    return descriptor


def config_yaml(name: str, kind: type) -> str:
    """Return the text of config/<name>.yaml: every parameter with its default and sentence."""
    lines = [
        f'# Parameters of the node `{name}`; every one is listed with its default.',
        f'# ros2 run motor_sysid {name} --ros-args --params-file config/{name}.yaml',
        '/**:',
        '  ros__parameters:',
    ]
    for item in fields(kind):
        spec = spec_of(item)
        notes = [spec.sentence, f'[{spec.range_text()}]' if spec.range_text() else '']
        notes.append('May be changed while running.' if spec.live else '')
        lines += textwrap.wrap(
            ' '.join(note for note in notes if note),
            95, initial_indent='    # ', subsequent_indent='    # ',
        )  # fmt: skip
        lines.append(f'    {item.name}: {_yaml(item.default)}')
    return '\n'.join(lines) + '\n'


def _yaml(value: object) -> str:
    if isinstance(value, tuple):
        return '[' + ', '.join(_yaml(text) for text in value or ('',)) + ']'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        text = repr(value)
        return text if '.' in text else text.replace('e', '.0e')  # YAML reads 1e-05 as a text
    return f"'{value}'" if isinstance(value, str) else str(value)
