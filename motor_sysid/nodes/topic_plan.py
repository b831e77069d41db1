"""One topic to listen to: where its stamp and its signals lie, and how they are read."""

from dataclasses import dataclass
import math

from motor_sysid.errors import UserError
from motor_sysid.recording.cdr import PRIMITIVES, TIME
from motor_sysid.recording.definitions import definitions, Types
from motor_sysid.recording.field_path import parse_path
from motor_sysid.recording.field_reader import FieldReader, Number
from motor_sysid.recording.messages import Topic
from motor_sysid.recording.sources import Source
from motor_sysid.signals.units import parse_unit

SECOND = 1_000_000_000
LAST = 2**31 * SECOND
"""Stamps lie below, as the messages of ROS can carry them: before 2038."""


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

    Parameters
    ----------
    plan:
        What is read.
    types:
        Definitions that know the type; default: those of ROS 2 Jazzy.

    Attributes
    ----------
    doubt:
        What is odd about a stamp that was left out, in words; empty if none was.

    Raises
    ------
    UserError
        If the type is not known, or has no such stamp.
    """

    def __init__(self, plan: TopicPlan, types: Types | None = None) -> None:
        self._plan, self.doubt = plan, ''
        types = types or definitions([Topic(plan.topic, plan.message_type)])
        paths = _stamp_paths(plan, types)
        self._parts = len(paths)
        self._unit = round(parse_unit(plan.stamp_unit).factor * SECOND)
        fields = (source.field for source in plan.sources)
        self._read = FieldReader(plan.message_type, (*paths, *fields), types).read

    def read(self, data: bytes, received: int) -> tuple[int | None, tuple[Number, ...]]:
        """Return the stamp (ns), None if there is none, and the signals as they were sent.

        Parameters
        ----------
        data:
            The message as CDR.
        received:
            When it was received, ns.
        """
        values = self._read(data)
        if self._parts == 2:
            stamp: Number = int(values[0]) * SECOND + int(values[1])
        elif self._parts:
            stamp = values[0] * self._unit
        else:
            return received, values
        if 0 <= stamp < LAST:
            return round(stamp), values[self._parts :]
        if not math.isnan(stamp):
            self.doubt = self.doubt or self._odd(values[0])
        return None, values[self._parts :]

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
