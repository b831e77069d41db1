"""One topic to listen to: where its stamp and its signals lie, and how they are read."""

from dataclasses import dataclass
import math
import re

from motor_sysid.errors import UserError
from motor_sysid.recording.cdr import PRIMITIVES, strings_of, TIME
from motor_sysid.recording.definitions import definitions, Types
from motor_sysid.recording.field_path import parse_path
from motor_sysid.recording.field_reader import FieldReader, Number
from motor_sysid.recording.messages import Topic
from motor_sysid.recording.sources import Source
from motor_sysid.signals.units import parse_unit

SECOND = 1_000_000_000
LAST = 2**31 * SECOND
"""Stamps lie below, as the messages of ROS can carry them: before 2038."""
ABSENT = math.nan
"""What `FieldReader` gives for a field that a message does not have: this very object."""
FIRST, JOINT = '[0]', re.compile(r'[^\[\]\s]+')


@dataclass(frozen=True)
class TopicPlan:
    """One topic to listen to.

    Attributes
    ----------
    topic, message_type:
        Its name as in the msg_config file, and its type.
    stamp, stamp_unit:
        ``header``, ``receive`` or the path of a time or of a number, and the unit of that.
    sources:
        The signals that it carries.
    """

    topic: str
    message_type: str
    stamp: str
    stamp_unit: str
    sources: tuple[Source, ...]

    def reader(self, types: Types | None = None) -> 'TopicReader':
        """Return a reader of the messages, by definitions that know their type."""
        return TopicReader(self, types)


class TopicReader:
    """Reads stamps and signals of the messages of one topic.

    Several nodes may publish on one topic, each its own joints.  A field such as ``velocity[0]``
    follows the joint that comes first in the first message.

    Parameters
    ----------
    plan:
        What is read.
    types:
        Definitions that know the type; default: those of ROS 2 Jazzy.

    Attributes
    ----------
    doubts:
        What is odd about the messages, in words, by its kind.
    foreign:
        Messages that have none of the signals, as those of another joint.

    Raises
    ------
    UserError
        If the type is not known, or has no such stamp.
    """

    def __init__(self, plan: TopicPlan, types: Types | None = None) -> None:
        self._plan, self.doubts, self.foreign = plan, dict[str, str](), 0
        self._types = types or definitions([Topic(plan.topic, plan.message_type)])
        self._paths = _stamp_paths(plan, self._types)
        self._parts, self._followed = len(self._paths), ''
        self._unit = round(parse_unit(plan.stamp_unit).factor * SECOND)
        self._read = self._read_first

    def read(self, data: bytes, received: int) -> tuple[int | None, tuple[Number, ...]] | None:
        """Return the stamp (ns), None if there is none, and the signals as they were sent.

        Parameters
        ----------
        data:
            The message as CDR.
        received:
            When it was received, ns.

        Returns
        -------
        None for a message that has none of the signals.
        """
        values = self._read(data)
        stamp: Number = received
        if self._parts == 2:
            stamp = int(values[0]) * SECOND + int(values[1])
        elif self._parts:
            stamp = values[0] * self._unit
        signals = values[self._parts :]
        if self._parts and not 0 <= stamp < LAST:
            if not math.isnan(stamp) and 'stamp' not in self.doubts:
                self.doubts['stamp'] = self._odd(values[0])
            return None, signals
        if signals[0] is ABSENT and all(value is ABSENT for value in signals):
            self._note_foreign(data)
            return None
        return round(stamp), signals

    def _read_first(self, data: bytes) -> tuple[Number, ...]:
        """Read the first message, which tells the joint to follow."""
        fields = [source.field for source in self._plan.sources]
        by_place = [field for field in fields if field.endswith(FIRST) and '.' not in field]
        names = self._joints(data) if by_place else []
        if names and JOINT.fullmatch(names[0]):
            named = f'[name={names[0]}]'
            fields = [f.replace(FIRST, named) if f in by_place else f for f in fields]
            self._followed = by_place[0].replace(FIRST, named)
            if len(names) > 1:
                self._note_joints(f'carries {len(names)} joints ({", ".join(names)})')
        read = FieldReader(self._plan.message_type, (*self._paths, *fields), self._types).read
        self._read = read
        return read(data)

    def _joints(self, data: bytes) -> list[str]:
        """Return what a message lists under `name`; nothing where its type has no such field."""
        return strings_of(data, self._types, self._plan.message_type, 'name')

    def _note_foreign(self, data: bytes) -> None:
        """Count a message without signals; say so where a joint was taken by its place alone."""
        self.foreign += 1
        if self._followed and 'joints' not in self.doubts:
            other = ''.join(self._joints(data)[:1])
            self._note_joints(f'has messages of another joint, too ({other or "without a name"})')

    def _note_joints(self, what: str) -> None:
        self.doubts['joints'] = (
            f'`{self._plan.topic}` {what}; the one that came first is taken, which may be another '
            'motor than the one that the voltage belongs to. Choose in a msg_config file, e.g. '
            f'`field: {self._followed}`'
        )

    def _odd(self, value: Number) -> str:
        unit = self._plan.stamp_unit if self._parts == 1 else 's'
        return (
            f'stamp {value:g} {unit} of topic `{self._plan.topic}` lies outside 0 to '
            f'{LAST // SECOND} s; such messages are left out. Look at `stamp` and `stamp_unit` in '
            'the msg_config file'
        )


def _stamp_paths(plan: TopicPlan, types: Types) -> tuple[str, ...]:
    """Return the paths of seconds and nanoseconds, or of one number; none for the reception."""
    if plan.stamp == 'receive':
        return ()
    path = 'header.stamp' if plan.stamp == 'header' else plan.stamp
    kind = plan.message_type
    for step in parse_path(path):
        kind = {field.name: field.kind for field in types.get(kind, ())}.get(step.field, '')
    if kind == TIME:
        return f'{path}.sec', f'{path}.nanosec'
    if kind in PRIMITIVES:
        return (path,)
    raise UserError(
        f'`{plan.message_type}` of topic `{plan.topic}` has no stamp `{path}`; write '
        '`stamp: receive` for it in a msg_config file (times of reception jitter), or the path of '
        'a time or number that it has'
    )
