"""A model as YAML text and back, to the last bit: schema ``motor_sysid/model/1``.

A file names the motor kind, the effects, and every parameter with its unit.  What a hand-written
file leaves out (sigma, box, free, description) is taken from the kind or the effect.
"""

from collections.abc import Mapping
from dataclasses import replace
import math
from pathlib import Path

import yaml

from motor_sysid import __version__
from motor_sysid.errors import UserError
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.parameters import Parameter, ParameterSet
from motor_sysid.whole_file import write_whole
from motor_sysid.yaml_text import load_yaml, read_utf8

SCHEMA = 'motor_sysid/model/1'

_KEYS = (
    'schema', 'written_by', 'motor', 'title', 'speed_sensor', 'linear', 'effects', 'parameters',
    'provenance',
)  # fmt: skip
_PARAMETER_KEYS = ('value', 'unit', 'sigma', 'lower', 'upper', 'free', 'description')


def save_model(model: Model, path: str | Path) -> None:
    """Write a model to a YAML file; the file appears whole or not at all.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    target = Path(path)
    if target.is_dir():
        raise UserError(f'cannot write model file {target}: it is a folder; name a file in it')
    try:
        write_whole(target, dump_model(model))
    except OSError as problem:
        raise UserError(f'cannot write model file {target}: {problem.strerror}') from problem


def load_model(path: str | Path) -> Model:
    """Read a model from a YAML file.

    Raises
    ------
    UserError
        If the file cannot be read or does not describe a model; the message says where and why.
    """
    source = Path(path)
    try:
        text = read_utf8(source)
    except UserError as problem:
        raise UserError(f'cannot read model file {source}: {problem}') from problem
    return parse_model(text, str(source))


def dump_model(model: Model) -> str:
    """Return the YAML text of a model; floats in their shortest exact form."""
    content = {
        'schema': SCHEMA,
        'written_by': f'motor_sysid {__version__}',
        'motor': model.motor,
        'title': model.kind.title,
        'speed_sensor': model.speed_sensor.value,
        'linear': model.linear,
        'effects': [
            {'key': key, 'title': effect(key).card.title, 'equation': effect(key).card.equation}
            for key in model.effects
        ],
        'parameters': {p.name: _parameter_entry(p) for p in model.parameters},
        'provenance': {str(name): str(note) for name, note in model.provenance.items()},
    }
    return yaml.dump(content, None, _Dumper, sort_keys=False, allow_unicode=True, width=99)


class _Dumper(yaml.SafeDumper):
    """Writes every text so that it is read again as it is."""


def _represent_text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    """Quote the one line break that PyYAML writes, but reads as another one."""
    style = '"' if '\x85' in text else None
    return dumper.represent_scalar('tag:yaml.org,2002:str', text, style)


_Dumper.add_representer(str, _represent_text)


def parse_model(text: str, where: str = 'model') -> Model:
    """Return the model that a YAML text describes.

    Parameters
    ----------
    text:
        The YAML text.
    where:
        What to call it in messages: the file, usually.

    Raises
    ------
    UserError
        If it is not a model of schema ``motor_sysid/model/1``, has a key twice, names an unknown
        motor, effect or parameter, gives another unit than the SI unit, or a value outside its
        box.
    """
    try:
        return _build(_content(text))
    except UserError as problem:
        raise UserError(f'{where}: {problem}') from problem


def _parameter_entry(p: Parameter) -> dict[str, object]:
    return {name: getattr(p, name) for name in _PARAMETER_KEYS}


def _content(text: str) -> Mapping[str, object]:
    content = load_yaml(text)
    if not isinstance(content, dict) or content.get('schema') != SCHEMA:
        found = content.get('schema') if isinstance(content, dict) else None
        raise UserError(
            f'no model file: `schema` is {found!r}, expected {SCHEMA!r}; see docs/models.md'
        )
    _refuse_unknown(content, _KEYS, 'entry')
    return content


def _refuse_unknown(found: Mapping[str, object], known: tuple[str, ...], what: str) -> None:
    for name in found:
        if name not in known:
            raise UserError(f'unknown {what} `{name}`; known are {", ".join(known)}')


def _build(content: Mapping[str, object]) -> Model:
    model = Model.base(
        _text(content, 'motor'),
        speed_sensor=_sensor(content.get('speed_sensor', SpeedSensor.IDEAL.value)),
        linear=_flag(content.get('linear', False), 'linear'),
    )
    for key in _effect_keys(content.get('effects') or []):
        model = model.with_effect(key)
    given = content.get('parameters') or {}
    if not isinstance(given, dict):
        raise UserError('`parameters` must be a mapping of name to value and unit')
    _refuse_unknown(given, tuple(p.name for p in model.parameters), 'parameter')
    items = [_parameter(p, given[p.name]) if p.name in given else p for p in model.parameters]
    notes = content.get('provenance') or {}
    if not isinstance(notes, dict):
        raise UserError('`provenance` must be a mapping of texts')
    provenance = {str(name): str(note) for name, note in notes.items()}
    return replace(model, parameters=ParameterSet(tuple(items)), provenance=provenance)


def _text(content: Mapping[str, object], name: str) -> str:
    value = content.get(name)
    if not isinstance(value, str):
        raise UserError(f'`{name}` is missing; give a text such as `{name}: brushed_dc`')
    return value


def _sensor(value: object) -> SpeedSensor:
    for sensor in SpeedSensor:
        if sensor.value == value:
            return sensor
    *known, last = (sensor.value for sensor in SpeedSensor)
    raise UserError(f'`speed_sensor` is {value!r}; give {", ".join(known)} or {last}')


def _flag(value: object, name: str) -> bool:
    if isinstance(value, bool):
        return value
    raise UserError(f'`{name}` is {value!r}; give true or false')


def _effect_keys(entries: object) -> list[str]:
    """Return the keys of effects given as texts or as mappings with a `key`."""
    keys = []
    for entry in entries if isinstance(entries, list) else [entries]:
        key = entry.get('key') if isinstance(entry, dict) else entry
        if not isinstance(key, str):
            raise UserError(f'`effects` holds {entry!r}; give a list of effect keys')
        keys.append(key)
    return keys


def _parameter(default: Parameter, entry: object) -> Parameter:
    """Return a parameter with what the entry says: a mapping, or a bare number in SI."""
    given = entry if isinstance(entry, dict) else {'value': entry}
    _refuse_unknown(given, _PARAMETER_KEYS, f'entry of parameter `{default.name}`')
    if given.get('unit', default.unit) != default.unit:
        raise UserError(
            f'`{default.name}` is given in {given["unit"]!r}; the unit is {default.unit!r}: '
            'convert the value'
        )
    name = default.name
    sigma = given.get('sigma')
    fresh = replace(
        default,
        lower=_number(given.get('lower', default.lower), f'{name}.lower'),
        upper=_number(given.get('upper', default.upper), f'{name}.upper'),
        free=_flag(given.get('free', default.free), f'{name}.free'),
        description=str(given.get('description', default.description)),
    )
    value = _number(given.get('value', default.value), name)
    checked = ParameterSet((fresh,)).with_values({name: value})[name]
    return checked if sigma is None else replace(checked, sigma=_sigma(sigma, name))


def _sigma(value: object, name: str) -> float:
    sigma = _number(value, f'{name}.sigma')
    if sigma < 0:
        raise UserError(f'`{name}.sigma` is {sigma:g}; a standard deviation is not negative')
    return sigma


def _number(value: object, name: str) -> float:
    """Return a number; YAML reads ``1e-5`` (without a dot) as text, people mean a number."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise UserError(f'`{name}` is {value!r}; give a number')
    try:
        number = float(value)
    except (ValueError, OverflowError):
        raise UserError(f'`{name}` is {value!r}; give a number') from None
    if math.isnan(number):
        raise UserError(f'`{name}` is not a number (NaN)')
    return number
