"""A profile as a file: YAML of schema ``motor_sysid/profile/1``, or a CSV of samples.

The YAML lists the parts with their seconds and values in the profile's unit, so that a person can
read and change it; the limits that the profile was designed for go with it.  The CSV has two
columns, ``time [s]`` and for instance ``speed_reference [rad/s]``, for any other tool; the time
may be in any unit.
"""

from collections.abc import Mapping
from contextlib import suppress
import csv
from dataclasses import fields
import itertools
import math
from pathlib import Path
import re

import yaml

from motor_sysid.control.profile import Hold, Part, Profile, SHAPES, SPEED
from motor_sysid.errors import UserError
from motor_sysid.signals.channels import BY_NAME
from motor_sysid.signals.units import parse_unit
from motor_sysid.yaml_text import load_yaml, read_utf8

SCHEMA = 'motor_sysid/profile/1'
LIMITS = ('input', 'speed', 'current', 'travel')
"""What a profile file may limit: the input in its unit, rad/s, A, and rad from the start."""

_TURNS = ('first', 'last')
_HEADER = re.compile(r'\s*(\w+)\s*\[(.+)\]\s*')


def save_profile(
    profile: Profile,
    path: Path,
    *,
    limits: Mapping[str, float] | None = None,
    note: str = '',
    dt: float = 0.001,
) -> None:
    """Write a profile: ``.csv`` as samples every `dt` s, any other name as YAML.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    sampled = path.suffix == '.csv'
    text = _table(profile, dt) if sampled else dump_profile(profile, limits=limits, note=note)
    try:
        path.write_text(text, encoding='utf-8')
    except OSError as problem:
        raise UserError(f'cannot write profile {path}: {problem.strerror}') from problem


def load_profile(path: Path) -> tuple[Profile, dict[str, float]]:
    """Read a profile and the limits that it names.

    Raises
    ------
    UserError
        If the file cannot be read or is no profile.
    """
    try:
        text = read_utf8(path)
    except UserError as problem:
        raise UserError(f'cannot read profile {path}: {problem}') from problem
    try:
        return (_from_table(text, path.stem), {}) if path.suffix == '.csv' else parse_profile(text)
    except UserError as problem:
        raise UserError(f'{path}: {problem}') from problem


def dump_profile(
    profile: Profile, *, limits: Mapping[str, float] | None = None, note: str = ''
) -> str:
    """Return the YAML text of a profile; floats in their shortest exact form."""
    content: dict[str, object] = {'schema': SCHEMA, 'name': profile.name}
    if note:
        content['note'] = note
    content |= {
        'signal': profile.signal,
        'unit': profile.unit,
        'duration_s': profile.duration,
        'limits': {name: float(v) for name, v in (limits or {}).items() if math.isfinite(v)},
        'parts': part_entries(profile),
    }
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=99)


def part_entries(profile: Profile) -> list[dict[str, str | float]]:
    """Return the parts as plain values: shape, seconds, and levels in the profile's unit."""
    whole = sum(part.share for part in profile.parts)
    entries = []
    for part in profile.parts:
        shape = part.shape
        entry: dict[str, str | float] = {
            'shape': shape.key, 'seconds': part.share / whole * profile.duration,
        }  # fmt: skip
        for item in fields(shape):
            value = float(getattr(shape, item.name))
            entry[item.name] = value if item.name in _TURNS else value * profile.level
        entries.append(entry)
    return entries


def parse_profile(text: str) -> tuple[Profile, dict[str, float]]:
    """Return the profile that a YAML text describes, and its limits.

    Raises
    ------
    UserError
        If it is not of schema ``motor_sysid/profile/1``; the message says what is wrong.
    """
    content = load_yaml(text)
    if not isinstance(content, dict) or content.get('schema') != SCHEMA:
        found = content.get('schema') if isinstance(content, dict) else None
        raise UserError(f'`schema` is {found!r}, expected {SCHEMA!r}; see docs/suggest.md')
    entries = content.get('parts')
    if not isinstance(entries, list) or not entries:
        raise UserError('a profile needs `parts`, each with a shape and seconds')
    parts = tuple(_part(entry, k) for k, entry in enumerate(entries, 1))
    signal, unit = str(content.get('signal', SPEED)), str(content.get('unit', ''))
    duration = sum(part.share for part in parts)
    name = str(content.get('name', 'profile'))
    profile = Profile(name, 1.0, duration, parts, signal, _unit(signal, unit))
    return profile, _limits(content.get('limits') or {})


def _part(entry: object, place: int) -> Part:
    if not isinstance(entry, dict) or entry.get('shape') not in SHAPES:
        raise UserError(f'part {place}: `shape` must be one of {", ".join(SHAPES)}')
    kind = SHAPES[entry['shape']]
    names = [item.name for item in fields(kind)]
    if set(entry) != {'shape', 'seconds', *names}:
        raise UserError(f'part {place}: a {kind.key} has shape, seconds, {", ".join(names)}')
    numbers = [_number(entry[name], f'part {place}: `{name}`') for name in names]
    seconds = _number(entry['seconds'], f'part {place}: `seconds`')
    if seconds <= 0:
        raise UserError(f'part {place}: `seconds` = {seconds:g} must be positive')
    return Part(seconds, kind(*numbers))


def _number(value: object, what: str) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool):
        with suppress(OverflowError):
            if math.isfinite(value):
                return float(value)
    raise UserError(f'{what} = {value!r} is not a finite number')


def _unit(signal: str, unit: str) -> str:
    channel = BY_NAME.get(signal)
    if channel is None:
        raise UserError(f'unknown signal `{signal}`; a profile drives {SPEED} or the motor input')
    if unit not in ('', *channel.units):
        raise UserError(f'`{signal}` in `{unit}`; its unit is {" or ".join(channel.units)}')
    return unit or channel.units[0]


def _seconds(unit: str) -> float:
    """Return how many seconds a unit of time is."""
    parsed = parse_unit(unit)
    if parsed.si != 's':
        raise UserError(f'`time [{unit}]` is no time; write it in s, ms or us')
    return parsed.factor


def _limits(given: object) -> dict[str, float]:
    if not isinstance(given, dict) or set(given) - set(LIMITS):
        raise UserError(f'`limits` may name {", ".join(LIMITS)}')
    limits = {name: _number(value, f'limit `{name}`') for name, value in given.items()}
    for name, value in limits.items():
        if value <= 0:
            raise UserError(f'limit `{name}` = {value:g} must be positive')
    return limits


def _table(profile: Profile, dt: float) -> str:
    rows = [f'time [s],{profile.signal} [{profile.unit}]']
    rows += [f'{k * dt:.9g},{float(v)!r}' for k, v in enumerate(profile.sampled(dt))]
    return '\n'.join(rows) + '\n'


def _from_table(text: str, name: str) -> Profile:
    """Return a profile that holds each value until the next time, the last as long as its step."""
    header, *rows = csv.reader(text.splitlines() or [''])
    found = [_HEADER.fullmatch(title) for title in header]
    if len(found) != 2 or found[0] is None or found[1] is None or found[0][1] != 'time':
        raise UserError(f'a profile has two columns, `time [s]` and `{SPEED} [rad/s]` or an input')
    signal, unit = found[1][1], _unit(found[1][1], found[1][2])
    second = _seconds(found[0][2])
    try:
        times, values = ([float(row[j]) for row in rows] for j in (0, 1))
    except (ValueError, IndexError) as problem:
        raise UserError(f'not a table of two numbers per line: {problem}') from problem
    steps = [(b - a) * second for a, b in itertools.pairwise(times)]
    if not steps or min(steps) <= 0 or not all(math.isfinite(v) for v in values):
        raise UserError('a profile needs two or more finite values at rising times')
    parts = tuple(Part(s, Hold(v)) for s, v in zip((*steps, steps[-1]), values, strict=True))
    return Profile(name, 1.0, sum(part.share for part in parts), parts, signal, unit)
