"""Where each signal of a record comes from: the content of a msg_config file, checked."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.signals.channels import BY_NAME
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.units import COUNT, parse_unit, TURN, Unit
from motor_sysid.signals.wrapping import find_wrap, unwrapped, Wrap

Array = NDArray[np.float64]

DIVIDED_BY_GEAR = ('position', 'speed', 'acceleration', 'position_reference', 'speed_reference')
MULTIPLIED_BY_GEAR = ('torque', 'force')


@dataclass(frozen=True)
class Condition:
    """A source counts only if a text field of the topic's first message is (not) one of these."""

    field: str
    allowed: frozenset[str] = frozenset()
    refused: frozenset[str] = frozenset()

    def holds(self, text: str) -> bool:
        """Tell whether the text meets the condition."""
        return text not in self.refused and (not self.allowed or text in self.allowed)


@dataclass(frozen=True)
class Source:
    """One source of one signal.

    The value in SI is ``sign * (scale * raw + offset)``, taken from `unit` to SI, and through the
    gear: motion divided by `gear_ratio`, torque and force multiplied.

    Attributes
    ----------
    signal:
        Name in the record; a name that begins with ``_`` is a helper and does not get there.
    topic, type, field:
        Topic, message type (checked if given) and path of the value, for a bag.
    column:
        Header of the column, for a table.
    product, sum:
        Names of other signals to multiply or add.
    constant:
        A number, for what is not recorded.
    unit:
        Unit of the scaled value; default: the usual SI unit of the signal.
    counts_per_turn:
        Needed for the units ``counts`` and ``counts/s``.
    gear_ratio:
        Turns of the sensor's shaft per turn of the record's shaft.
    wrap:
        Range after which the sensor starts anew, in `unit`; 0: never; None: look for it.
    shift:
        Rows of a table by which the values belong later; negative: earlier.
    stamp:
        ``header``, ``receive`` or the path of a time or number in the message.
    stamp_unit:
        Unit of that number.
    when:
        Condition on the topic's first message.
    optional:
        Whether it may be absent.
    """

    signal: str
    topic: str = ''
    type: str = ''
    field: str = ''
    column: str = ''
    product: tuple[str, ...] = ()
    sum: tuple[str, ...] = ()
    constant: float | None = None
    unit: str = ''
    scale: float = 1.0
    offset: float = 0.0
    sign: int = 1
    counts_per_turn: float = 0.0
    gear_ratio: float = 1.0
    wrap: float | None = None
    shift: int = 0
    stamp: str = 'header'
    stamp_unit: str = 's'
    when: Condition | None = None
    optional: bool = False

    @property
    def parts(self) -> tuple[str, ...]:
        """The signals that this one is computed from."""
        return self.product or self.sum

    @property
    def derived(self) -> bool:
        """Whether it is computed rather than read."""
        return bool(self.parts) or self.constant is not None

    def si_unit(self) -> str:
        """Return the SI unit that the values have.

        Raises
        ------
        UserError
            If the unit does not fit the signal.
        """
        unit = self._parsed_unit()
        si = unit.si.replace(COUNT, 'rad') if self.counts_per_turn else unit.si
        channel = BY_NAME.get(self.signal)
        if COUNT in si:
            raise UserError(
                f'`{self.signal}` is given in {unit.symbol}; '
                'add `counts_per_turn: N` to its source in a msg_config file'
            )
        if channel and si not in channel.units:
            raise UserError(
                f'`{self.signal}` is given in `{unit.symbol}`, which is no unit of it; '
                f'it takes anything that converts to {" or ".join(channel.units)}'
            )
        return si

    def to_si(self, raw: Array) -> Array:
        """Scale raw values (N,), convert them to SI and take them through the gear."""
        return self._through_gear(self._at_sensor(raw))

    def continuous(self, raw: Array, findings: list[Finding]) -> Array:
        """Return `to_si` (N,), made continuous where the sensor starts anew at its range's end.

        A range that is neither given nor a turn is told in `findings`.
        """
        values = self._at_sensor(raw)
        period = self._range(values, findings) if self.wrap is None else self.wrap * self._unit()
        return self._through_gear(unwrapped(values, period) if period else values)

    def _range(self, values: Array, findings: list[Finding]) -> float:
        """Find the range in rad after which an angle starts anew, 0 if it does not."""
        found = find_wrap(values, self._unit()) if self.si_unit() == 'rad' else None
        if found is None or found.period == TURN:
            return TURN if found else 0.0
        if self.signal != 'position' or not found.certain:
            return 0.0  # a reference may jump
        findings.append(self._unwrapped(found))
        return found.period

    def _unwrapped(self, found: Wrap) -> Finding:
        """Return the finding for a range that is no turn."""
        period = f'{found.period / self._unit():.9g}'
        return Finding(
            Severity.INFO, 'position_unwrapped',
            f'the sensor of `{self.column or self.topic}` starts anew every {period} '
            f'{self._parsed_unit().symbol}, as {found.places.size} jumps of that size show; the '
            'position was made continuous',
            '', f'if it moved like that, write `wrap: 0` in a msg_config file; `wrap: {period}` '
            'makes it sure', {'period_rad': found.period, 'jumps': found.places.size},
        )  # fmt: skip

    def given_range(self) -> float | None:
        """Return the range that was given, as `to_si` has its values; None if none was."""
        if self.wrap is None:
            return None
        return abs(float(self._through_gear(np.array(self.wrap * self._unit()))))

    def _unit(self) -> float:
        """Return the size of the unit in SI."""
        factor = self._parsed_unit().factor
        return factor * TURN / self.counts_per_turn if self.counts_per_turn else factor

    def _at_sensor(self, raw: Array) -> Array:
        values = raw
        if self.scale != 1 or self.offset != 0 or self.sign != 1:
            values = self.sign * (self.scale * raw + self.offset)
        values = self._parsed_unit().to_si(values)
        return values * (TURN / self.counts_per_turn) if self.counts_per_turn else values

    def _through_gear(self, values: Array) -> Array:
        if self.gear_ratio == 1:
            return values
        turns = self.signal in DIVIDED_BY_GEAR
        return values / self.gear_ratio if turns else values * self.gear_ratio

    def _parsed_unit(self) -> Unit:
        channel = BY_NAME.get(self.signal)
        return parse_unit(self.unit or (channel.units[0] if channel else '1'))

    def describe(self) -> str:
        """Return where it comes from and what is done to it, for the notes of a record."""
        place = self.column or f'{self.topic} {self.field}'.strip()
        if self.parts:
            place = (' * ' if self.product else ' + ').join(self.parts)
        elif self.constant is not None:
            place = f'{self.constant:g}'
        steps = [f'* {self.scale:g}'] if self.scale != 1 else []
        steps += [f'+ {self.offset:g}'] if self.offset else []
        steps += ['sign changed'] if self.sign < 0 else []
        steps += [f'gear {self.gear_ratio:g}'] if self.gear_ratio != 1 else []
        steps += [f'{self.shift:+d} row(s)'] if self.shift else []
        unit = [] if not self.unit or f'[{self.unit}]' in place else [f'[{self.unit}]']
        return ' '.join([place, *steps, *unit])


ISO = 'iso8601'
"""Unit of a time column that holds dates."""


@dataclass(frozen=True)
class TimeColumn:
    """The column of a table that carries the time; its unit may be `ISO`.

    One count of it lasts `step` of its unit; where there is no column, rows follow each other at
    that pace.
    """

    column: str
    unit: str = 's'
    step: float = 1.0


@dataclass(frozen=True)
class MsgConfig:
    """Which topic or column carries which signal.

    Attributes
    ----------
    sources:
        Signal to its sources; the first one that the data has is taken.
    time:
        Time column of a table, or its step.
    segment_by:
        Column whose every change begins a new record.
    namespace:
        Prefix of the topics, where a bag has several robots.
    base_clock:
        Signal whose stamps become the time of the record; default: that of the fastest topic.
    max_gap:
        Largest step in s within one record; default: from the data.
    origin:
        File it was read from, for messages.
    """

    sources: Mapping[str, tuple[Source, ...]]
    time: TimeColumn | None = None
    segment_by: str = ''
    namespace: str = ''
    base_clock: str = ''
    max_gap: float | None = None
    origin: str = ''
    description: str = ''
    notes: tuple[str, ...] = field(default=())

    def all_sources(self) -> tuple[Source, ...]:
        """Return every source of every signal."""
        return tuple(source for sources in self.sources.values() for source in sources)


def quoted(text: str) -> str:
    """Return a header as YAML takes it, whatever stands in it."""
    return "'" + text.replace("'", "''") + "'"
