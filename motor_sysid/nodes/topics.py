"""Which topics carry the signals of a model, by a msg_config file, and how they become columns."""

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.nodes.topic_plan import TopicPlan
from motor_sysid.recording.sources import MsgConfig, Source
from motor_sysid.signals.phases import CURRENTS

Array = NDArray[np.float64]

VECTOR, JOINT = 'geometry_msgs/msg/Vector3Stamped', 'sensor_msgs/msg/JointState'

DEFAULT_SOURCES = (
    Source('voltage', topic='motor/voltage', type=VECTOR, field='vector.x'),
    Source('current', topic='motor/current', type=VECTOR, field='vector.x'),
    Source('speed', topic='motor/speed', type=JOINT, field='velocity[0]'),
    Source('position', topic='motor/speed', type=JOINT, field='position[0]', optional=True),
    *(
        Source(f'{kind}_{axis}', topic=f'motor/{kind}', type=VECTOR, field=f'vector.{part}')
        for kind in ('voltage', 'current')
        for axis, part in ('ax', 'by', 'cz', 'dx', 'qy')
    ),
)
"""The package's own topics; a vector carries x, or a, b, c, or d, q, as the motor kind asks."""

DEFAULT_CONFIG = MsgConfig(
    {source.signal: (source,) for source in DEFAULT_SOURCES}, origin='of this package'
)

Chosen = dict[str, Source]
"""Signal to the source that was chosen for it."""

DC = 'dc'
"""``frame_id`` of a motor that has no phases; the others have that of their kind."""


@dataclass(frozen=True)
class SignalPlan:
    """Everything to listen to, and what is computed from it.

    Attributes
    ----------
    topics:
        The topics, in the order of the columns that they carry.
    computed:
        Products, sums and constants, in an order in which each needs only what is before it.
    base_clock:
        Signal whose stamps the rows have where those of the topics differ; empty to choose.
    """

    topics: tuple[TopicPlan, ...]
    computed: tuple[Source, ...] = ()
    base_clock: str = ''

    @cached_property
    def sources(self) -> tuple[Source, ...]:
        """Source of every column."""
        return (*(s for topic in self.topics for s in topic.sources), *self.computed)

    @property
    def names(self) -> tuple[str, ...]:
        """The topics as they stand in the msg_config file."""
        return tuple(topic.topic for topic in self.topics)

    @property
    def by_reception(self) -> str:
        """Topics whose messages have no other stamp than their reception, in words."""
        return ', '.join(topic.topic for topic in self.topics if topic.stamp == 'receive')

    @property
    def untyped(self) -> set[str]:
        """Topics whose type is not known."""
        return {topic.topic for topic in self.topics if not topic.message_type}

    @cached_property
    def _plain(self) -> bool:
        """Whether all values that are read come in SI as they are."""
        return all(_is_plain(source) for source in self.read)

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """Signal of every column."""
        return tuple(source.signal for source in self.sources)

    @cached_property
    def read(self) -> tuple[Source, ...]:
        """Source of every column that is read, not computed."""
        return self.sources[: len(self.sources) - len(self.computed)]

    def to_si(self, raw: Array) -> Array:
        """Return (K, read) values in SI from those that were sent."""
        if self._plain:
            return raw
        return np.column_stack([s.to_si(raw[:, k]) for k, s in enumerate(self.read)])

    def with_computed(self, read: Array) -> Array:
        """Return (K, columns) values: those that were read, in SI, and what they make."""
        if not self.computed:
            return read
        columns = {source.signal: read[:, k] for k, source in enumerate(self.read)}
        for source in self.computed:
            values = _computed(source, columns, read.shape[0])
            columns[source.signal] = source.to_si(values)
        return np.column_stack(list(columns.values()))


def sources_of(config: MsgConfig) -> tuple[Source, ...]:
    """Return the sources of a msg_config, their relative topics in its namespace if it has one."""
    start = f'/{config.namespace}/' if config.namespace else ''
    return tuple(
        replace(source, topic=start + source.topic)
        if source.topic and not source.topic.startswith('/')
        else source
        for source in config.all_sources()
    )


def plan_signals(
    sources: Sequence[Source], wanted: Sequence[str], frame: str = DC, base_clock: str = '',
    there: Collection[str] | None = None, spare: Collection[str] = (),
) -> SignalPlan:  # fmt: skip
    """Choose a source for each wanted signal.

    It is the first one that can be read live and whose topic is `there` (None: all are), or else
    the first.  No message has come yet: one with a condition on the ``frame_id`` is taken if that
    of the motor kind, `frame`, meets it, one with a condition on another text if an empty one
    does.  One of the signals that are `spare` is left out where all its sources are optional, and
    their topics are neither there nor wanted for another signal.

    Raises
    ------
    UserError
        If a signal has no such source.
    """
    chosen: Chosen = {}
    optional = set(spare) - {source.signal for source in sources if not source.optional}
    for signal in sorted(wanted, key=optional.__contains__):
        ways = _ways(signal, sources, frame, there, chosen)
        if ways and signal in optional:
            ways.append(chosen)
        if not ways:
            raise lacking(f'`{signal}`')
        chosen = _nearest(ways, there)
    grouped: dict[tuple[str, str, str, str], list[Source]] = defaultdict(list)
    for source in chosen.values():
        if source.topic:
            place = source.topic, source.type, source.stamp, source.stamp_unit
            grouped[place].append(source)
    topics = tuple(TopicPlan(*place, tuple(members)) for place, members in grouped.items())
    computed = tuple(source for source in chosen.values() if source.derived)
    known = any(source.signal == base_clock for topic in topics for source in topic.sources)
    return SignalPlan(topics, computed, base_clock if known else '')


def is_carried(signal: str, sources: Sequence[Source], frame: str = DC) -> bool:
    """Tell whether a signal has a source that can be read live."""
    return bool(_ways(signal, sources, frame, None, {}))


def with_third_current(sources: Sequence[Source], frame: str) -> tuple[Source, ...]:
    """Return the sources with one of the phase current that has none, where the other two have.

    It is minus their sum (floating neutral).
    """
    carried = [name for name in CURRENTS if is_carried(name, sources, frame)]
    if len(carried) != 2:
        return tuple(sources)
    (missing,) = set(CURRENTS) - set(carried)
    return *sources, Source(missing, sum=tuple(carried), sign=-1)


def lacking(signals: str) -> UserError:
    """Return the error for signals, in words, that have no source."""
    return UserError(
        f'no topic carries {signals}; name one in the msg_config file, or choose a motor kind '
        'that does not need it'
    )


def with_types(sources: Sequence[Source], types: Mapping[str, str]) -> tuple[Source, ...]:
    """Return the sources with the types of their topics, where they give none themselves."""
    known = {**types, **{source.topic: source.type for source in sources if source.type}}
    return tuple(
        replace(source, type=source.type or known.get(source.topic, '')) for source in sources
    )


def _ways(
    signal: str, sources: Sequence[Source], frame: str, there: Collection[str] | None,
    chosen: Chosen,
) -> list[Chosen]:  # fmt: skip
    """Return what was chosen with each source of a signal, and with what it is computed from."""
    if signal in chosen:
        return [chosen]
    found = []
    for source in sources:
        if source.signal != signal or not (source.topic or source.derived):
            continue
        ways = [chosen] if _meets(source, frame) else []
        for part in source.parts:
            ways = _ways(part, sources, frame, there, _nearest(ways, there)) if ways else []
        if ways:
            found.append({**_nearest(ways, there), signal: source})
    return found


def _nearest(ways: Sequence[Chosen], there: Collection[str] | None) -> Chosen:
    """Return the first of those of which the fewest topics are not there."""
    if there is None:
        return ways[0]
    return min(ways, key=lambda way: len({s.topic for s in way.values()} - {'', *there}))


def _meets(source: Source, frame: str) -> bool:
    """Tell whether the condition of a source holds for all that is known before a message."""
    if source.when is None:
        return True
    return source.when.holds(frame if source.when.field == 'header.frame_id' else '')


def _is_plain(source: Source) -> bool:
    """Whether values come in SI as they are."""
    unit = source.unit in ('', source.si_unit())
    return (
        unit
        and source.counts_per_turn == 0
        and ((source.scale, source.offset, source.sign, source.gear_ratio) == (1.0, 0.0, 1, 1.0))
    )


def _computed(source: Source, columns: Mapping[str, Array], count: int) -> Array:
    if source.constant is not None:
        return np.full(count, source.constant)
    parts = [columns[part] for part in source.parts]
    values = parts[0]
    for part in parts[1:]:
        values = values * part if source.product else values + part
    return values
