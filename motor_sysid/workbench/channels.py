"""Which signals a page draws, and which of them share a panel."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from motor_sysid.diagnosis.result.result import Diagnosis
from motor_sysid.signals.record import Record

AXES = frozenset('abcdq')
INPUTS = frozenset({'voltage', 'duty', 'torque', 'force', 'supply_voltage', 'voltage_command'})
REFERENCES: Mapping[str, str] = {
    'speed_reference': 'speed',
    'position_reference': 'position',
    'voltage_command': 'voltage',
    'current_command': 'current',
}
ORDER = (
    'speed', 'position', 'current', 'voltage', 'duty', 'force', 'torque', 'voltage_command',
    'supply_voltage', 'temperature', 'hall_sector',
)  # fmt: skip
FOLDED = frozenset({'supply_voltage', 'temperature', 'hall_sector'})
"""Panels that are folded away until asked for."""

PRIMARY = ('speed', 'position', 'current')


@dataclass(frozen=True)
class Channel:
    """A signal with its panel; `kind` is output, input or reference."""

    name: str
    panel: str
    kind: str
    unit: str

    @property
    def label(self) -> str:
        """Short name inside its panel."""
        if self.kind == 'reference':
            return 'reference' if self.name.endswith('reference') else 'command'
        return self.name.removeprefix(f'{self.panel}_')


@dataclass(frozen=True)
class Panel:
    """Channels that are drawn together."""

    name: str
    unit: str
    channels: tuple[str, ...]
    shown: bool
    stepped: bool


def panel_of(name: str) -> str:
    """Return the panel of a signal: phases and dq axes of a quantity share one."""
    stem, _, suffix = name.rpartition('_')
    return stem if stem and suffix in AXES else name


def channels_of(diagnosis: Diagnosis) -> tuple[Channel, ...]:
    """Return every signal that all records have, in the order of the panels."""
    first, *rest = diagnosis.records
    names = [name for name in first if all(name in record for record in rest)]
    outputs = {name for step in diagnosis.steps for name in step.predictions[0]}
    channels = [_channel(name, first, outputs, names) for name in names]
    return tuple(sorted(channels, key=_rank))


def primary_of(channels: Sequence[Channel]) -> str:
    """Return the output whose error the page opens with; empty if there is none."""
    outputs = [channel for channel in channels if channel.kind == 'output']
    for panel in PRIMARY:
        for channel in outputs:
            if channel.panel == panel:
                return channel.name
    return outputs[0].name if outputs else ''


def panels_of(channels: Sequence[Channel], primary: str) -> tuple[Panel, ...]:
    """Group channels into panels; the primary output's panel comes first."""
    names = list(dict.fromkeys(channel.panel for channel in channels))
    names.sort(key=lambda name: name != panel_of(primary))
    return tuple(_panel(name, channels, names) for name in names)


def _channel(name: str, record: Record, outputs: set[str], names: Sequence[str]) -> Channel:
    unit = record.units[name]
    target = REFERENCES.get(name)
    if name not in outputs and target in names:
        return Channel(name, str(target), 'reference', unit)
    panel = panel_of(name)
    return Channel(name, panel, 'output' if name in outputs else 'input', unit)


def _rank(channel: Channel) -> tuple[int, bool, str]:
    place = ORDER.index(channel.panel) if channel.panel in ORDER else len(ORDER)
    return place, channel.kind == 'reference', channel.name


def _panel(name: str, channels: Sequence[Channel], names: Sequence[str]) -> Panel:
    own = [channel for channel in channels if channel.panel == name]
    unit = own[0].unit
    turning = name == 'position' and unit == 'rad' and 'speed' in names
    stepped = all(c.kind != 'output' for c in own) and panel_of(own[0].name) in INPUTS
    names_of_own = tuple(channel.name for channel in own)
    return Panel(name, unit, names_of_own, name not in FOLDED and not turning, stepped)
