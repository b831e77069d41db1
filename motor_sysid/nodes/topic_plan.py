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

    Raises
    ------
    UserError
        If the type is not known, or has no such stamp.
    """

    def __init__(self, plan: TopicPlan, types: Types | None = None) -> None:
        types = types or definitions([Topic(plan.topic, plan.message_type)])
        paths = _stamp_paths(plan, types)
        self._parts = len(paths)
        self._unit = round(parse_unit(plan.stamp_unit).factor * SECOND)
        fields = (source.field for source in plan.sources)
        self._read = FieldReader(plan.message_type, (*paths, *fields), types).read

    def read(self, data: bytes, received: int) -> tuple[int | None, tuple[Number, ...]]:
        """Return the stamp (ns), None if the message has none, and the signals as they were sent.

        Parameters
        ----------
        data:
            The message as CDR.
        received:
            When it was received, ns.
        """
        values = self._read(data)
        if self._parts == 2:
            return int(values[0]) * SECOND + int(values[1]), values[2:]
        if not self._parts:
            return received, values
        stamp = round(values[0] * self._unit) if math.isfinite(values[0]) else None
        return stamp, values[1:]


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
