"""Read msg_config files: which topic or column carries which signal, in which unit and sign."""

from collections.abc import Callable, Collection, Mapping
import math
from pathlib import Path

from motor_sysid.errors import UserError
from motor_sysid.recording.field_path import parse_path
from motor_sysid.recording.sources import (
    Condition,
    DIVIDED_BY_GEAR,
    ISO,
    MsgConfig,
    MULTIPLIED_BY_GEAR,
    Source,
    TimeColumn,
)
from motor_sysid.resources import shipped_directory, shipped_file
from motor_sysid.signals.channels import BY_NAME
from motor_sysid.signals.units import did_you_mean, parse_unit
from motor_sysid.yaml_text import load_yaml, read_utf8

TOP_KEYS = ('description', 'namespace', 'base_clock', 'max_gap', 'time', 'segment_by', 'stamp',
            'signals')  # fmt: skip
PLACES = ('topic', 'column', 'product', 'sum', 'constant')
SOURCE_KEYS = (*PLACES, 'type', 'field', 'unit', 'scale', 'offset', 'sign', 'counts_per_turn',
               'gear_ratio', 'wrap', 'shift', 'stamp', 'stamp_unit', 'when',
               'optional')  # fmt: skip
TIME_KEYS = ('column', 'step', 'unit')
WRAPPING = ('position', 'position_reference')
GEARED = (*DIVIDED_BY_GEAR, *MULTIPLIED_BY_GEAR)
CONDITION_KEYS = ('field', 'is', 'is_not')
LEAST_READ = 2
"""Signals of a table that a shipped file must read to be proposed for it."""

Table = Mapping[str, object]


def load_msg_config(name: str | Path) -> MsgConfig:
    """Read a msg_config file.

    Parameters
    ----------
    name:
        Path of a file, or the name of one that ships with the package, such as ``emps``.

    Raises
    ------
    UserError
        If it cannot be read or says something that is not understood; the message names the key
        and those that are allowed.
    """
    path = Path(name)
    if not path.is_file():
        shipped = not path.suffix and len(path.parts) == 1
        if path.is_dir() and not (shipped and _ships(str(name))):
            raise UserError(f'msg_config {path} is a folder; name a file in it')
        if not shipped:
            raise UserError(f'msg_config file {path} does not exist')
        path = shipped_file('msg_config', str(name))
    try:
        content = load_yaml(read_utf8(path))
    except UserError as problem:
        raise UserError(f'{path} cannot be read: {problem}') from None
    return parse_msg_config(content, str(path))


def _ships(name: str) -> bool:
    return (shipped_directory('msg_config') / f'{name}.yaml').is_file()


def said_of_shipped(columns: Collection[str]) -> str:
    """Say which shipped msg_config file fits the headers of a table, or nothing.

    It reads the time and two signals at least; of several the one that reads most.
    """
    files = sorted(shipped_directory('msg_config').glob('*.yaml'))
    fits = [(load_msg_config(file), file.stem) for file in files]
    config, name = max(fits, key=lambda fit: _count_read(fit[0], columns))
    if _count_read(config, columns) < LEAST_READ:
        return ''
    return f'`--msg-config {name}` reads them, if that is what they are ({config.description}). '


def _count_read(config: MsgConfig, columns: Collection[str]) -> int:
    """Return how many signals of a msg_config stand in a table; 0 if its time does not."""
    if config.time is None or config.time.column not in columns:
        return 0
    read = ([s.column in columns for s in sources] for sources in config.sources.values())
    return sum(any(found) for found in read)


def parse_msg_config(content: object, origin: str = 'msg_config') -> MsgConfig:
    """Check the content of a msg_config file; see `load_msg_config`."""
    reader = _Reader(origin)
    top = reader.table(content, '', TOP_KEYS)
    signals = reader.table(top.get('signals'), 'signals', None)
    if not signals:
        raise UserError(f'{origin}: `signals` is missing or empty; list at least one signal')
    stamp = reader.text(top, 'stamp', 'header')
    sources = {
        reader.signal_name(name): reader.sources(entry, name, stamp)
        for name, entry in signals.items()
    }
    config = MsgConfig(
        sources=sources,
        time=reader.time(top.get('time')),
        segment_by=reader.text(top, 'segment_by'),
        namespace=reader.text(top, 'namespace').strip('/'),
        base_clock=reader.text(top, 'base_clock'),
        max_gap=reader.max_gap(top),
        origin=origin,
        description=reader.text(top, 'description'),
    )
    reader.check(config)
    return config


class _Reader:
    """Reads entries of one file, and says which one is wrong."""

    def __init__(self, origin: str) -> None:
        self.origin = origin

    def fail(self, where: str, problem: str) -> UserError:
        """Return the error that names file and key."""
        return UserError(f'{self.origin}: {f"`{where}` " if where else ""}{problem}')

    def table(self, value: object, where: str, allowed: Collection[str] | None) -> Table:
        """Return a mapping with known keys only."""
        if value is None:
            return {}
        if not isinstance(value, dict):
            raise self.fail(where, f'must be a mapping of keys to values, not `{value}`')
        for key in value:
            if allowed is not None and key not in allowed:
                raise self.fail(
                    where,
                    f'has no key `{key}`{did_you_mean(str(key), allowed)}; '
                    f'allowed are {", ".join(allowed)}',
                )
        return {str(key): entry for key, entry in value.items()}

    def text(self, table: Table, key: str, default: str = '', where: str = '') -> str:
        """Return a text entry."""
        value = table.get(key, default)
        if isinstance(value, bool) or not isinstance(value, (str, int)):
            raise self.fail(_join(where, key), f'must be a text, not `{value}`')
        return str(value).strip()

    def number(self, table: Table, key: str, default: float, where: str = '') -> float:
        """Return a number entry."""
        value = table.get(key, default)
        try:
            if isinstance(value, bool) or not isinstance(value, (int, float, str)):
                raise ValueError
            number = float(value)  # YAML reads 1e-3 as a text
            if not math.isfinite(number):
                raise ValueError
            return number
        except (ValueError, OverflowError):
            raise self.fail(_join(where, key), f'must be a number, not `{value}`') from None

    def max_gap(self, top: Table) -> float | None:
        """Return the longest step within one record in s, None for the default."""
        if 'max_gap' not in top:
            return None
        value = self.number(top, 'max_gap', 0.0)
        if value <= 0.0:
            raise self.fail(
                'max_gap', f'is {value:g} s, must be above 0; leave it out for the default'
            )
        return value

    def flag(self, table: Table, key: str, where: str) -> bool:
        """Return a true-or-false entry."""
        value = table.get(key, False)
        if not isinstance(value, bool):
            raise self.fail(_join(where, key), f'must be true or false, not `{value}`')
        return value

    def names(self, table: Table, key: str, where: str) -> tuple[str, ...]:
        """Return an entry that lists texts (one alone may stand without brackets)."""
        value = table.get(key, [])
        listed = value if isinstance(value, list) else [value]
        if not all(isinstance(item, str) for item in listed):
            raise self.fail(_join(where, key), f'must be a list of names, not `{value}`')
        return tuple(listed)

    def signal_name(self, name: str) -> str:
        """Return a signal name: a canonical one, or a helper that begins with ``_``."""
        if name in BY_NAME or name.startswith('_'):
            return name
        raise self.fail(
            f'signals.{name}',
            f'is not a signal{did_you_mean(name, BY_NAME)}; signals are {", ".join(BY_NAME)}; '
            'a helper for product and sum begins with `_`',
        )

    def time(self, value: object) -> TimeColumn | None:
        """Return the time column, or the step; ``time: t_s`` alone means seconds."""
        if value is None:
            return None
        if isinstance(value, str):
            return TimeColumn(value)
        table = self.table(value, 'time', TIME_KEYS)
        column = self.text(table, 'column', where='time')
        unit = self.text(table, 'unit', 's', 'time')
        if not column and 'step' not in table:
            raise self.fail('time', 'needs `column: HEADER`, or `step: SECONDS` without one')
        if unit != ISO and parse_unit(unit).si != 's':
            raise self.fail('time.unit', f'must be a time (s, ms, us, ns, {ISO}), not `{unit}`')
        if 'step' not in table:
            return TimeColumn(column, unit)
        step = self.number(table, 'step', 0.0, 'time')
        if unit == ISO or not step > 0.0:
            what = 'of a count of the column' if column else 'between rows'
            raise self.fail('time.step', f'must be a time above 0 {what}, not `{step:g}`')
        return TimeColumn(column, unit, step)

    def sources(self, entry: object, name: str, stamp: str) -> tuple[Source, ...]:
        """Return the source or the list of alternative sources of a signal."""
        entries = entry if isinstance(entry, list) else [entry]
        if not entries:
            raise self.fail(f'signals.{name}', 'has no source')
        return tuple(self.source(item, name, stamp) for item in entries)

    def source(self, entry: object, name: str, stamp: str) -> Source:
        """Return one source."""
        where = f'signals.{name}'
        table = self.table(entry, where, SOURCE_KEYS)
        given = [key for key in PLACES if key in table]
        if len(given) != 1:
            raise self.fail(where, f'needs exactly one of {", ".join(PLACES)}, has {given}')
        source = Source(
            signal=name,
            topic=self.text(table, 'topic', where=where),
            type=self.text(table, 'type', where=where),
            field=self.text(table, 'field', where=where),
            column=self.text(table, 'column', where=where),
            product=self.names(table, 'product', where),
            sum=self.names(table, 'sum', where),
            constant=self.number(table, 'constant', 0.0, where) if 'constant' in table else None,
            unit=self.text(table, 'unit', where=where),
            scale=self.number(table, 'scale', 1.0, where),
            offset=self.number(table, 'offset', 0.0, where),
            sign=self.sign(table, where),
            counts_per_turn=self.number(table, 'counts_per_turn', 0.0, where),
            gear_ratio=self.number(table, 'gear_ratio', 1.0, where),
            wrap=self.number(table, 'wrap', 0.0, where) if 'wrap' in table else None,
            shift=self.whole(table, 'shift', where),
            stamp=self.text(table, 'stamp', stamp, where),
            stamp_unit=self.text(table, 'stamp_unit', 's', where),
            when=self.condition(table.get('when'), where),
            optional=self.flag(table, 'optional', where),
        )
        if getattr(source, given[0]) in ('', ()):
            raise self.fail(f'{where}.{given[0]}', 'is empty; name what the signal is read from')
        self.check_source(source, where)
        return source

    def sign(self, table: Table, where: str) -> int:
        """Return 1 or -1."""
        value = self.number(table, 'sign', 1.0, where)
        if value not in (1.0, -1.0):
            raise self.fail(f'{where}.sign', f'must be 1 or -1, not {value:g}')
        return int(value)

    def whole(self, table: Table, key: str, where: str) -> int:
        """Return a whole number entry, 0 where there is none."""
        value = self.number(table, key, 0.0, where)
        if not value.is_integer():
            raise self.fail(f'{where}.{key}', f'must be a whole number, not {value:g}')
        return int(value)

    def condition(self, entry: object, where: str) -> Condition | None:
        """Return a ``when`` entry."""
        if entry is None:
            return None
        table = self.table(entry, f'{where}.when', CONDITION_KEYS)
        field = self.text(table, 'field', 'header.frame_id', f'{where}.when')
        allowed = self.names(table, 'is', f'{where}.when')
        refused = self.names(table, 'is_not', f'{where}.when')
        return Condition(field, frozenset(allowed), frozenset(refused))

    def check_source(self, source: Source, where: str) -> None:
        """Refuse what cannot be right in one source."""
        checks: tuple[tuple[bool, str], ...] = (
            (bool(source.topic) and not source.field, 'needs `field`, e.g. `field: vector.x`'),
            (not source.topic and bool(source.field), '`field` goes with `topic` only'),
            (source.gear_ratio <= 0, f'`gear_ratio` is {source.gear_ratio:g}, must be above 0'),
            (
                source.gear_ratio != 1 and source.signal not in GEARED,
                f'has a `gear_ratio`, which goes with {", ".join(GEARED)} only; write another '
                'ratio as `scale`',
            ),
            ((source.wrap or 0.0) < 0, f'`wrap` is {source.wrap}, must be 0 (never) or above'),
            (
                source.wrap is not None and source.signal not in WRAPPING,
                f'has a `wrap`, which goes with {" and ".join(WRAPPING)} only',
            ),
            (source.counts_per_turn < 0, '`counts_per_turn` must be above 0'),
            (bool(source.shift) and not source.column, '`shift` goes with `column` only'),
            (source.scale == 0, '`scale` is 0, so that the signal would be constant'),
        )
        for wrong, problem in checks:
            if wrong:
                raise self.fail(where, problem)
        paths = [source.field] if source.field else []
        paths += [source.stamp] if source.stamp not in {'header', 'receive'} else []
        for step in (*(_parser(parse_path, path) for path in paths), source.si_unit):
            try:
                step()
            except UserError as error:
                raise self.fail(where, str(error)) from None

    def check(self, config: MsgConfig) -> None:
        """Refuse what cannot be right between the signals."""
        for source in config.all_sources():
            for part in source.parts:
                if part not in config.sources:
                    raise self.fail(
                        f'signals.{source.signal}',
                        f'is computed from `{part}`{did_you_mean(part, config.sources)}, '
                        'which is not among the signals',
                    )
        if config.base_clock and config.base_clock not in config.sources:
            raise self.fail('base_clock', f'`{config.base_clock}` is not among the signals')
        if all(source.derived for source in config.all_sources()):
            raise self.fail('signals', 'reads nothing: every signal is computed')
        _order(config, self)


def _order(config: MsgConfig, reader: _Reader) -> None:
    """Refuse signals that are computed from each other in a circle."""

    def visit(name: str, path: tuple[str, ...]) -> None:
        if name in path:
            raise reader.fail('signals', f'form a circle: {" from ".join((*path, name))}')
        for source in config.sources[name]:
            for part in source.parts:
                visit(part, (*path, name))

    for name in config.sources:
        visit(name, ())


def _parser(parse: Callable[[str], object], text: str) -> Callable[[], object]:
    return lambda: parse(text)


def _join(where: str, key: str) -> str:
    return f'{where}.{key}' if where else key
