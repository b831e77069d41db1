"""Understand CSV headers that bear their unit: ``speed [rad/s]``, ``speed_rad_s``, ``t_s``."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
import re

from motor_sysid.errors import UserError
from motor_sysid.recording.sources import ISO, MsgConfig, quoted, Source, TimeColumn
from motor_sysid.signals.channels import BY_NAME
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.units import parse_unit

TIME = 'time'
ALIASES = {
    't': TIME, 'timestamp': TIME, 'stamp': TIME,
    'velocity': 'speed', 'omega': 'speed', 'angular_velocity': 'speed',
    'angle': 'position', 'theta': 'position',
    'velocity_reference': 'speed_reference', 'velocity_ref': 'speed_reference',
    'speed_ref': 'speed_reference', 'position_ref': 'position_reference',
    'duty_cycle': 'duty', 'pwm_duty': 'duty', 'battery_voltage': 'supply_voltage',
}  # fmt: skip
SUFFIXES = {
    's': 's', 'ms': 'ms', 'us': 'us', 'ns': 'ns', 'v': 'V', 'mv': 'mV', 'a': 'A', 'ma': 'mA',
    'rad': 'rad', 'deg': 'deg', 'rev': 'turns', 'turns': 'turns', 'counts': 'counts',
    'rad_s': 'rad/s', 'rad_per_s': 'rad/s', 'deg_s': 'deg/s', 'deg_per_s': 'deg/s', 'rpm': 'rpm',
    'rev_s': 'turns/s', 'rev_per_s': 'turns/s', 'turns_s': 'turns/s', 'turns_per_s': 'turns/s',
    'm': 'm', 'mm': 'mm', 'm_s': 'm/s', 'm_per_s': 'm/s', 'mm_s': 'mm/s', 'n': 'N', 'nm': 'N m',
    'n_m': 'N m', 'mn_m': 'mN m', 'c': 'degC', 'degc': 'degC', 'percent': '%',
}  # fmt: skip
_WANTED = {'speed': 'speed_reference', 'position': 'position_reference'}
_WANTING = {'ref', 'reference', 'cmd', 'command', 'goal', 'target', 'set', 'setpoint', 'desired'}
"""Words in the headers of what was wanted."""
USUAL = {
    's': TIME, 'V': 'voltage', 'A': 'current', 'rad/s': 'speed', 'm/s': 'speed', 'rad': 'position',
    'm': 'position', 'N': 'force', 'N m': 'torque', 'degC': 'temperature',
}  # fmt: skip
"""Signal that usually has an SI unit, for examples in messages."""
_DRIVING, _MOVING = {'voltage', 'duty', 'force', 'torque', 'current'}, {'speed', 'position'}
"""Signals of which an example names one at least."""
COLUMN = 'COLUMN'
"""Stands in examples for a header that the user has to name."""
SI_TIME = 's'


@dataclass(frozen=True)
class Heading:
    """What a header says; `unit` is empty where it says none."""

    column: str
    signal: str
    unit: str


def understand(column: str, columns: Sequence[str]) -> Heading | None:
    """Return what a header means, or None if it is not one of ours.

    ``current_a`` is a current in ampere, unless another phase stands beside it.
    """
    name, unit = _parts(column)
    if unit:
        signal = _signal(name)
        return Heading(column, signal, unit) if signal else None
    others = {_plain(other) for other in columns}
    if name == 'current_a' and not others & {'current_b', 'current_c'}:
        return Heading(column, 'current', 'A')
    if signal := _signal(name):
        return Heading(column, signal, '')
    for cut in [i for i, letter in enumerate(name) if letter == '_']:
        signal, suffix = _signal(name[:cut]), name[cut + 1 :]
        if signal and suffix in SUFFIXES:
            return Heading(column, signal, SUFFIXES[suffix])
    return None


def config_from_headers(
    origin: str,
    columns: Sequence[str],
    dated: Collection[str] = (),
    said_of_shipped: Callable[[Sequence[str]], str] = lambda _: '',
) -> tuple[MsgConfig, list[Finding]]:
    """Return the msg_config that the headers of a CSV amount to.

    Parameters
    ----------
    origin:
        The file, for messages.
    columns:
        Its headers.
    dated:
        Those of columns that hold dates; a time without unit is read as such.
    said_of_shipped:
        Says which msg_config file that ships with the package fits such headers, if any.

    Raises
    ------
    UserError
        If time or every signal is missing, a unit does not fit, or two columns mean one signal;
        the message shows the lines of a msg_config file that would help.
    """
    headings = [heading for column in columns if (heading := understand(column, columns))]
    headings = [_as_date(heading, dated) for heading in headings]
    _refuse_twins(origin, headings)
    time = next((heading for heading in headings if heading.signal == TIME), None)
    counts = [heading for heading in headings if 'counts' in heading.unit]
    signals = [heading for heading in headings if heading.signal != TIME and heading not in counts]
    if time is None or not signals:
        missing = 'time' if time is None else 'signal'
        ready = said_of_shipped(columns)
        raise UserError(_help(origin, columns, headings, missing, dated, ready))
    if time.unit not in {'', ISO} and parse_unit(time.unit).si != SI_TIME:
        raise UserError(f'{origin}: column `{time.column}` is no time; use s, ms, us or ns')
    sources = {}
    for heading in signals:
        unit = heading.unit if heading.unit != '-' else ''
        source = Source(heading.signal, column=heading.column, unit=unit)
        try:
            source.si_unit()
        except UserError as error:
            raise UserError(f'{origin}: column `{heading.column}`: {error}') from None
        sources[heading.signal] = (source,)
    config = MsgConfig(sources, TimeColumn(time.column, time.unit or SI_TIME), origin=origin)
    return config, [*_ignored(columns, headings), *_assumed(headings), *_unscaled(counts)]


def _plain(name: str) -> str:
    return re.sub(r'[\s\-.]+', '_', name.strip().strip('"').lower())


def _parts(column: str) -> tuple[str, str]:
    """Return the name in a header, and the unit that stands in brackets (``-``: in empty ones)."""
    match = re.fullmatch(r'(.+?)\s*[\[(](.*)[\])]', column.strip())
    return (_plain(match[1]), match[2].strip() or '-') if match else (_plain(column), '')


def _as_date(heading: Heading, dated: Collection[str]) -> Heading:
    dates = heading.signal == TIME and not heading.unit and heading.column in dated
    return replace(heading, unit=ISO) if dates else heading


def _signal(name: str) -> str:
    name = ALIASES.get(name, name)
    return name if name in BY_NAME or name == TIME else ''


def _refuse_twins(origin: str, headings: Sequence[Heading]) -> None:
    seen: dict[str, str] = {}
    for heading in headings:
        if heading.signal in seen:
            raise UserError(
                f'{origin}: columns `{seen[heading.signal]}` and `{heading.column}` both mean '
                f'{heading.signal}; choose one through a msg_config file'
            )
        seen[heading.signal] = heading.column


def _ignored(columns: Sequence[str], headings: Sequence[Heading]) -> list[Finding]:
    used = {heading.column for heading in headings}
    left = [column for column in columns if column not in used]
    if not left:
        return []
    return [
        Finding(
            Severity.INFO, 'ignored_columns', f'columns not read: {", ".join(left)}',
            'nothing, if they are not needed',
            'name them in a msg_config file if they carry a signal',
            {'columns': len(left)},
        )
    ]  # fmt: skip


def _assumed(headings: Sequence[Heading]) -> list[Finding]:
    """Warn where a column bears no unit and one had to be assumed."""
    found = []
    for heading in headings:
        channel = BY_NAME.get(heading.signal)
        unit = channel.units[0] if channel else SI_TIME
        if heading.unit or unit == '1':
            continue
        found.append(
            Finding(
                Severity.WARNING, 'unit_assumed',
                f'column `{heading.column}` bears no unit; taken as {heading.signal} in {unit}',
                'a wrong unit gives a wrong model',
                f'write the header as `{heading.signal} [{unit}]`, with the unit that it is in',
            )
        )  # fmt: skip
    return found


def _unscaled(headings: Sequence[Heading]) -> list[Finding]:
    return [
        Finding(
            Severity.WARNING, 'counts_without_scale',
            f'column `{heading.column}` is in encoder counts, of unknown size; it was left out',
            f'{heading.signal} is missing from the record',
            f'in a msg_config file: `{heading.signal}: {{column: {quoted(heading.column)}, '
            'unit: counts, counts_per_turn: 2048}`',
        )
        for heading in headings
    ]  # fmt: skip


def _help(
    origin: str, columns: Sequence[str], headings: Sequence[Heading], missing: str,
    dated: Collection[str], ready: str,
) -> str:  # fmt: skip
    """Return the error for headers that are not understood, with what would help.

    That is YAML, and before it what is said of a msg_config file that is `ready`, if any.
    """
    understood = [heading.column for heading in headings]
    known = _guesses([column for column in columns if column not in understood])
    if dated:
        known[TIME] = (min(dated), ISO)
    known |= {heading.signal: (heading.column, heading.unit) for heading in headings}
    column, unit = known.pop(TIME, ('', ''))
    time = f'{quoted(column)}, unit: {unit or SI_TIME}}}'
    time = time if column else f'{COLUMN}, unit: {SI_TIME}}}  # or {{step: SECONDS}}'
    lines = [f'time: {{column: {time}', 'signals:']
    for signal, (column, unit) in known.items():
        unit = unit.strip('-') or BY_NAME[signal].units[0]
        lines.append(f'  {signal}: {{column: {quoted(column)}, unit: {quoted(unit)}}}')
    if not known.keys() & _DRIVING:
        lines += [f'  voltage: {{column: {COLUMN}, unit: V}}']
    if not known.keys() & _MOVING:
        lines += [f'  speed: {{column: {COLUMN}, unit: rad/s}}']
    yaml = '\n  '.join(lines)
    hint = f' (with headers in place of {COLUMN})' if f'column: {COLUMN}' in yaml else ''
    return (
        f'{origin}: no column is understood as a {missing}; its columns are '
        f'{", ".join(columns)}. {ready}Write headers with units (`time [s],'
        'voltage [V],current [A],speed [rad/s],position [rad]`), or say what the columns are in a '
        f'msg_config file, given with --msg-config FILE, for example{hint}\n  {yaml}'
    )


def _guesses(columns: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Guess signals from the unit that headers bear, for an example: (column, unit)."""
    found: dict[str, tuple[str, str]] = {}
    for column in sorted(columns, key=len):
        unit = _unit_of(column)
        signal = 'duty' if unit == '%' else USUAL.get(_si(unit), '')
        if signal in _WANTED and _is_wanted(column):
            signal = _WANTED[signal]
        if signal:
            found.setdefault(signal, (column, unit))
    return found


def _is_wanted(column: str) -> bool:
    """Tell whether a header speaks of what was wanted, not measured."""
    return not _WANTING.isdisjoint(re.split(r'[_\W]+', _parts(column)[0]))


def _unit_of(column: str) -> str:
    """Return the unit in brackets or at the end of a header, empty if there is none."""
    name, unit = _parts(column)
    ends = (suffix for suffix in SUFFIXES if f'_{name}'.endswith(f'_{suffix}'))
    return unit or SUFFIXES.get(max(ends, key=len, default=''), '')


def _si(unit: str) -> str:
    """Return the SI unit that a text converts to, empty if it is none."""
    try:
        return parse_unit(unit).si if unit else ''
    except UserError:
        return ''
