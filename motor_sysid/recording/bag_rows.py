"""From the messages of a bag to rows of signals, as a msg_config says."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.recording.align import align, choose_base, Series
from motor_sysid.recording.cdr import Column, column, strings_of, text_of
from motor_sysid.recording.clocks import clock_findings
from motor_sysid.recording.definitions import definitions, field_names, Types
from motor_sysid.recording.messages import Messages, Topic
from motor_sysid.recording.rosbag import Bag
from motor_sysid.recording.rows import empty_signals, Rows
from motor_sysid.recording.sources import MsgConfig, Source
from motor_sysid.signals.channels import CHANNELS, Role
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.units import did_you_mean, parse_unit

NAMED = {'voltage': 'V', 'current': 'A', 'torque': 'N m', 'position': 'rad', 'speed': 'rad/s'}
"""Words in the name of a topic that tell its signal, for examples in messages."""

INPUTS = tuple(channel.name for channel in CHANNELS if channel.role is Role.INPUT)
Chosen = dict[str, tuple[Source, Topic]]


def rows_of_bag(bag: Bag, config: MsgConfig) -> tuple[list[Rows], Chosen, list[Finding]]:
    """Read the signals that a msg_config names.

    Returns
    -------
    tuple
        Rows (one for each time the clock starts anew), the source that each signal was read from,
        and findings.

    Raises
    ------
    UserError
        If a topic or field that is not optional is missing, or nothing could be read; where the
        bag is damaged, with what is wrong.
    """
    if not bag.topics:
        bag.read(())  # finds out whether it is damaged
        raise UserError(_without_messages(bag, 'has no topics'))
    places = [(source, topic_of(bag, source, config)) for source in config.all_sources()]
    wanted = {topic.name: topic for _, topic in places if topic}
    if not wanted:
        raise UserError(_nothing_found(bag, config))
    messages = bag.read(list(wanted))
    if not any(len(found) for found in messages.values()):
        raise UserError(_without_messages(bag, f'has no messages on {", ".join(wanted)}'))
    types = definitions(wanted.values())
    present = [(s, t) for s, t in places if t and len(messages.get(t.name, ()))]
    reader = _Reader(messages, types)
    found = _choose(config, present, reader)
    chosen = reader.with_values(found)
    if not chosen:
        raise UserError(f'none of the fields named in {config.origin} holds any finite value')
    series = reader.series(chosen)
    if not series:
        raise UserError(
            f'{bag.path}: no message has a finite value of each of {", ".join(chosen)}; leave out '
            'in a msg_config file what is not measured'
        )
    units = {name: source.si_unit() for name, (source, _) in chosen.items()}
    clock = '' if config.base_clock in {*found} - {*chosen} else config.base_clock
    rows, joined = align(series, choose_base(series, clock), units)
    known = [*_missing_topics(bag, config, chosen), *_unread(bag, found), *reader.findings]
    return rows, chosen, [*known, *clock_findings(series), *joined]


def _without_messages(bag: Bag, what: str) -> str:
    """Return the message for a bag in which nothing is found, or nothing is left."""
    damage = [finding.message for finding in bag.findings if finding.code == 'damaged_bag']
    if damage:
        return f'{bag.path} {what} that can be read: {"; ".join(damage)}; copy it again'
    return f'{bag.path} {what}; nothing was recorded'


def topic_of(bag: Bag, source: Source, config: MsgConfig) -> Topic | None:
    """Return the topic of a source; None if it has none, or the bag has not.

    Raises
    ------
    UserError
        If the bag has several, or one of another type.
    """
    if not source.topic:
        return None
    name = source.topic
    if not name.startswith('/') and config.namespace:
        name = f'/{config.namespace}/{name}'
    topic = find_topic(bag, name, '`namespace: {}` in a msg_config file')
    if topic and source.type and source.type != topic.msgtype:
        raise UserError(
            f'topic `{topic.name}` has type `{topic.msgtype}`, the msg_config {config.origin} '
            f'says `{source.type}`'
        )
    return topic


def find_topic(bag: Bag, name: str, choice: str) -> Topic | None:
    """Return the topic of that name, None if there is none.

    A relative name also matches below any namespace; where it does below several, `choice` says
    how to choose the one whose namespace takes the place of its braces.
    """
    tail = name if name.startswith('/') else f'/{name}'
    matches = [t for t in bag.topics if t in (name, tail)]
    if not matches and not name.startswith('/'):
        matches = [t for t in bag.topics if t.endswith(tail)]
    if len(matches) > 1:
        raise UserError(
            f'{bag.path} has several topics for `{name}`: {", ".join(matches)}; choose one with '
            f'{choice.format(matches[0].removesuffix(tail))}'
        )
    return bag.topics[matches[0]] if matches else None


def _choose(
    config: MsgConfig, present: Sequence[tuple[Source, Topic]], reader: '_Reader'
) -> Chosen:
    """Take the first source of each signal that the bag has, one with values if there is one."""
    chosen: Chosen = {}
    for name, sources in config.sources.items():
        named = [place for place in present if place[0].signal == name and reader.applies(*place)]
        if named:
            chosen[name] = next((place for place in named if reader.has_values(*place)), named[0])
        required = [s for s in sources if not s.optional and not s.derived]
        if name not in chosen and required:
            topic = next((topic for source, topic in present if source is required[0]), None)
            raise UserError(reader.missing(required[0], topic, config))
    return chosen


class _Reader:
    """Reads fields of messages, and stamps, each once."""

    def __init__(self, messages: dict[str, Messages], types: Types) -> None:
        self.messages = messages
        self.types = types
        self.findings: list[Finding] = []
        self._columns: dict[tuple[str, str], Column] = {}
        self._followed: set[str] = set()

    def applies(self, source: Source, topic: Topic) -> bool:
        """Tell whether a source is in this bag."""
        first = self.messages[topic.name][0]
        if source.when:
            text = text_of(first, self.types, topic.msgtype, source.when.field)
            if not source.when.holds(text):
                return False
        return bool(np.any(self._column(topic, source.field).present))

    def has_values(self, source: Source, topic: Topic) -> bool:
        """Tell whether a source has a finite value anywhere."""
        read = self._column(topic, source.field)
        return bool(np.any(read.present & np.isfinite(read.values)))

    def with_values(self, found: Chosen) -> Chosen:
        """Leave out signals that have no value at all: drivers so fill what they do not measure.

        It is as expected where the source is optional and its topic carries others.
        """
        chosen = {name: place for name, place in found.items() if self.has_values(*place)}
        topics = {topic.name for _, topic in chosen.values()}
        for name, (source, topic) in found.items():
            if name not in chosen:
                expected = source.optional and topic.name in topics
                severity = Severity.INFO if expected else Severity.WARNING
                self.findings.append(empty_signals([name], severity))
        return chosen

    def missing(self, source: Source, topic: Topic | None, config: MsgConfig) -> str:
        """Return the message for a source that must be there and is not."""
        known = list(self.messages)
        where = f'{config.origin}: `{source.signal}` comes from topic `{source.topic}`'
        if topic and len(self.messages.get(topic.name, ())):
            names = self._joints(topic)
            lists = f'; they list {", ".join(names)}' if names else ''
            when = ' where its `when` holds' if source.when else ''
            return (
                f'{where}, no message of which has `{source.field}`{when}{lists}; name another '
                'field in a msg_config file, or add `optional: true` if the signal can be missing'
            )
        return (
            f'{where} ({source.field}), which the bag does not have or which is empty'
            f'{did_you_mean(source.topic, known)}; of the topics wanted it has '
            f'{", ".join(known)}; add `optional: true` if the signal can be missing'
        )

    def series(self, chosen: Chosen) -> list[Series]:
        """Return the chosen signals by topic and stamp."""
        groups: dict[tuple[str, str], list[str]] = defaultdict(list)
        for name, (source, topic) in chosen.items():
            groups[topic.name, source.stamp].append(name)
        found = []
        for (topic_name, _), names in groups.items():
            source, topic = chosen[names[0]]
            messages = self.messages[topic_name]
            stamps = self._stamps(source, topic)
            signals = {name: self._values(*chosen[name]) for name in names}
            stamped = source.stamp != 'receive'
            one = Series(topic_name, stamps, messages.received, signals, stamped)
            found.append(self._without_holes(one))
            self._note_joints(topic, [chosen[name][0] for name in names])
        return [one for one in found if one.stamps.size]

    def _column(self, topic: Topic, path: str) -> Column:
        key = topic.name, path
        if key not in self._columns:
            self._columns[key] = self._of_one_joint(topic, path, self._read(topic, path))
        return self._columns[key]

    def _read(self, topic: Topic, path: str) -> Column:
        return column(self.messages[topic.name], self.types, topic.msgtype, path)

    def _joints(self, topic: Topic, message: int = 0) -> list[str]:
        """Return what a message lists under `name`; nothing where its type has no such field."""
        data = self.messages[topic.name][message]
        return strings_of(data, self.types, topic.msgtype, 'name')

    def _of_one_joint(self, topic: Topic, path: str, read: Column) -> Column:
        """Follow the joint that comes first in the first message, where others come first later.

        Several nodes may publish on one topic, or one node in changing order.
        """
        if not path.endswith('[0]') or '.' in path or not (names := self._joints(topic)):
            return read
        named = self._read(topic, f'{path[:-3]}[name={names[0]}]')
        other = np.flatnonzero(read.present & ~(named.present & (named.values == read.values)))
        other = other[np.isfinite(read.values[other])]
        if other.size == 0 or (first := self._joints(topic, int(other[0]))[:1]) == names[:1]:
            return read
        self._followed.add(topic.name)
        self.findings.append(
            Finding(
                Severity.WARNING, 'several_joints',
                f'{other.size} of {read.values.size} messages of {topic.name} begin with another '
                f'joint than {names[0]} ({"".join(first) or "without a name"}); only '
                f'{names[0]} was taken',
                'this may be another motor than the one that the voltage belongs to',
                f'choose in a msg_config file, e.g. `field: {path[:-3]}[name={names[0]}]`',
                {'messages': int(other.size)},
            )
        )  # fmt: skip
        return named

    def _values(self, source: Source, topic: Topic) -> NDArray[np.float64]:
        read = self._column(topic, source.field)
        raw = np.where(read.present, read.values.astype(np.float64), np.nan)
        return source.continuous(raw, self.findings)

    def _stamps(self, source: Source, topic: Topic) -> NDArray[np.int64]:
        messages = self.messages[topic.name]
        if source.stamp == 'receive':
            return messages.shown
        path = 'header.stamp' if source.stamp == 'header' else source.stamp
        if source.stamp == 'header' and 'header' not in field_names(self.types, topic.msgtype):
            raise UserError(
                f'`{topic.msgtype}` of topic `{topic.name}` has no header stamp; write '
                '`stamp: receive` for it in a msg_config file (receive times jitter), or publish '
                'a stamped type'
            )
        read = self._column(topic, path)
        stamps = read.values
        if not read.is_time:
            factor = parse_unit(source.stamp_unit).factor * 1e9
            stamps = np.round(stamps.astype(np.float64) * factor).astype(np.int64)
        if not np.any(stamps):
            raise UserError(
                f'the stamps of topic `{topic.name}` are all zero; fill them where it is '
                'published, or write `stamp: receive` in a msg_config file'
            )
        return np.asarray(stamps, dtype=np.int64)

    def _without_holes(self, one: Series) -> Series:
        """Drop messages in which a value is missing or not finite."""
        good = np.all([np.isfinite(values) for values in one.signals.values()], axis=0)
        lost = int(np.sum(~good))
        if lost:
            self.findings.append(
                Finding(
                    Severity.WARNING, 'missing_values',
                    f'{lost} of {good.size} messages of {one.topic} have no finite '
                    f'{" or ".join(one.signals)}; left out',
                    'the record has holes there', 'look for the cause in the sensor or driver',
                    {'messages': lost},
                )
            )  # fmt: skip
        return one.take(good) if lost else one

    def _note_joints(self, topic: Topic, sources: Sequence[Source]) -> None:
        """Warn where one of several joints was taken by its place alone."""
        if not any(source.field.endswith('[0]') for source in sources):
            return
        names = self._joints(topic)
        if len(names) > 1 and topic.name not in self._followed:
            self.findings.append(
                Finding(
                    Severity.WARNING, 'several_joints',
                    f'{topic.name} carries {len(names)} joints ({", ".join(names)}); the first '
                    'was taken',
                    'this may be another motor than the one that the voltage belongs to',
                    f'choose in a msg_config file, e.g. `field: velocity[name={names[0]}]`',
                    {'joints': len(names)},
                )
            )  # fmt: skip


def _missing_topics(bag: Bag, config: MsgConfig, chosen: Chosen) -> list[Finding]:
    """Warn where nothing drives the motor, or nothing shows its motion, for want of a topic."""
    derived = {source.signal for source in config.all_sources() if source.derived}
    have = derived | set(chosen)
    found = []
    for role, signals in (('input', INPUTS), ('motion', ('speed', 'position'))):
        wanted = [s.topic for name in signals for s in config.sources.get(name, ()) if s.topic]
        if have & set(signals) or not wanted:
            continue
        found.append(
            Finding(
                Severity.WARNING, 'missing_topic',
                f'no {role} was recorded: the bag has no `{wanted[0]}`; its topics are '
                f'{", ".join(bag.topics)}',
                'a model cannot be fitted, or only in part',
                'record that topic too, or say in a msg_config file which topic carries it',
            )
        )  # fmt: skip
    return found


def _unread(bag: Bag, chosen: Chosen) -> list[Finding]:
    used = {topic.name for _, topic in chosen.values()}
    left = [f'{t.name} ({t.msgtype})' for t in bag.topics.values() if t.name not in used]
    if not left:
        return []
    return [
        Finding(
            Severity.INFO, 'unread_topics', f'topics not read: {", ".join(left)}',
            '', 'name them in a msg_config file if they carry a signal', {'topics': len(left)},
        )
    ]  # fmt: skip


def _nothing_found(bag: Bag, config: MsgConfig) -> str:
    """Return the message for a bag without any known topic, with the YAML that would help."""
    lines = [f'    {topic.name}  ({topic.msgtype})' for topic in bag.topics.values()]
    wanted = ', '.join(dict.fromkeys(s.topic for s in config.all_sources() if s.topic)) or 'none'
    examples: dict[str, str] = {}
    for topic in bag.topics.values():
        for signal, source in _guess(topic):
            examples.setdefault(signal, f'    {signal}: {{topic: {topic.name}, {source}}}')
    examples = examples or {'': '    speed: {topic: /TOPIC, field: FIELD, unit: rad/s}'}
    return '\n'.join(
        [
            f'{bag.path} has none of the topics named in {config.origin} ({wanted}). Its topics '
            'are',
            *lines,
            '  Say which of them carries what in a msg_config file, given with --msg-config FILE, '
            'for example',
            '  signals:',
            *examples.values(),
        ]
    )


def _guess(topic: Topic) -> list[tuple[str, str]]:
    """Guess signals from the type and name of a topic, for an example."""
    named = next((name for name in NAMED if name in topic.name.lower()), '')
    unit = NAMED.get(named, 'rad/s')
    signal = named or 'speed'
    if topic.msgtype == 'sensor_msgs/msg/JointState':
        return [
            ('speed', "field: 'velocity[0]', unit: rad/s"),
            ('position', "field: 'position[0]', unit: rad"),
        ]
    if topic.msgtype == 'sensor_msgs/msg/BatteryState':
        return [('supply_voltage', 'field: voltage, unit: V')]
    if topic.msgtype.endswith('/Vector3Stamped'):
        return [(signal, f'field: vector.x, unit: {unit}')]
    if topic.msgtype == 'std_msgs/msg/Float64':
        return [(signal, f'field: data, unit: {unit}, stamp: receive')]
    return []
