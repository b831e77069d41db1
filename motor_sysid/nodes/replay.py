"""Run the identifier's own code over a bag: the same estimates as live, bit for bit."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
import heapq
from pathlib import Path
import time

from rosbags.typesys import get_typestore, Stores

from motor_sysid.errors import UserError
from motor_sysid.estimation.stream import Event
from motor_sysid.nodes.configuration import Configuration
from motor_sysid.nodes.pipeline import Pipeline
from motor_sysid.nodes.statuses import estimate_statuses, text_of
from motor_sysid.nodes.topic_plan import TopicPlan, TopicReader
from motor_sysid.nodes.topics import DEFAULT_CONFIG, SignalPlan
from motor_sysid.recording.bag_rows import find_topic, topic_of
from motor_sysid.recording.definitions import definitions
from motor_sysid.recording.messages import Topic
from motor_sysid.recording.rosbag import Bag
from motor_sysid.recording.sources import MsgConfig

DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
Texts = Mapping[str, Mapping[str, str]]
"""Status name to its key-value texts."""


class NotRecorded(UserError):
    """The bag holds no configuration of an identifier."""


@dataclass(frozen=True)
class Published:
    """One message of ~/estimate as recorded: stamp in ns, and the texts of every status."""

    stamp: int
    statuses: Texts

    @property
    def first_stamp(self) -> int:
        """Stamp of the first sample that the estimator was given, ns."""
        return int(self.statuses['samples']['first_stamp'])


@dataclass(frozen=True)
class Check:
    """How the replayed estimates compare with the recorded ones.

    Attributes
    ----------
    compared:
        Recorded estimates that the replay reached with the same samples.
    unreachable:
        Recorded estimates that the bag does not hold all samples of.
    difference:
        The first difference, in words; empty if there is none.
    """

    compared: int
    unreachable: int
    difference: str = ''

    @property
    def equal(self) -> bool:
        """Whether something was compared and all of it was equal."""
        return bool(self.compared) and not self.difference


@dataclass(frozen=True)
class Replay:
    """What a replay gives.

    Attributes
    ----------
    configuration:
        What the identifier was set to.
    events:
        Every estimate and prediction, in order.
    samples, duration, seconds:
        Samples given to the estimator, their span in s, and the time that it took.
    dropped:
        Messages without partners.
    check:
        Comparison with the recorded estimates; None if the bag has none.
    """

    configuration: Configuration
    events: tuple[Event, ...]
    samples: int
    duration: float
    seconds: float
    dropped: int
    check: Check | None = None
    notes: tuple[str, ...] = field(default=())

    @property
    def estimates(self) -> list[Event]:
        """Events that carry estimates."""
        return [event for event in self.events if event.estimate is not None]


def replay(
    path: str | Path,
    configuration: Configuration | None = None,
    msg_config: MsgConfig = DEFAULT_CONFIG,
    node: str = 'identifier',
) -> Replay:
    """Run over a bag.

    Parameters
    ----------
    path:
        Bag folder or file.
    configuration:
        What the identifier is set to all the time; default: as recorded on ~/model, with every
        change at the sample at which it was made.
    msg_config:
        Which topic carries which signal.
    node:
        Name of the identifier whose topics are looked up in the bag, with its namespace where
        there are several; the topics of the motor are then those of this namespace, if it has any.

    Raises
    ------
    UserError
        If a needed topic is missing or not the only one of its name, or no configuration was
        recorded and none is given.
    """
    begin = time.perf_counter()
    bag = Bag(path)
    recorded = _published(bag, node, 'estimate')
    given, *changes = [configuration] if configuration else recorded_configurations(bag, node)
    plan = _plan(bag, given, _beside(bag, node, msg_config))
    pipeline = given.pipeline(plan, _readers(bag, plan), window=2)
    for change in changes:
        pipeline.stream.change(change.make, change.since)
    if recorded:
        pipeline.start_at(sorted({one.first_stamp for one in recorded}))
    events = tuple(_run(bag, pipeline, plan.topics))
    stamps = [event.stamp for event in events]
    notes = (*(one.message for one in bag.findings), *pipeline.doubts, *_notes(plan, recorded))
    return Replay(
        given,
        events,
        pipeline.stream.samples,
        (stamps[-1] - stamps[0]) * 1e-9 if stamps else 0.0,
        time.perf_counter() - begin,
        pipeline.join.counts.dropped,
        _compare(events, recorded) if recorded else None,
        notes,
    )


def recorded_configuration(bag: Bag, node: str = 'identifier') -> Configuration:
    """Return the first of `recorded_configurations`."""
    return recorded_configurations(bag, node)[0]


def recorded_configurations(bag: Bag, node: str = 'identifier') -> list[Configuration]:
    """Return the configurations that an identifier published on ~/model, in order.

    Each holds from the sample with the stamp `since` on; the last one that was published for a
    sample counts.

    Raises
    ------
    NotRecorded
        If the bag has none.
    UserError
        If more than one identifier has such a name.
    """
    messages = _published(bag, node, 'model')
    if not messages:
        raise NotRecorded(
            f'{bag.path} holds no configuration of an identifier (topic `{node}/model`); '
            'give `--model` and `--estimator`'
        )
    found: list[Configuration] = []
    for one in messages:
        configuration = Configuration.from_texts(one.statuses['configuration'])
        if found and found[-1].since == configuration.since:
            found.pop()
        found.append(configuration)
    return found


def _run(bag: Bag, pipeline: Pipeline, plans: Sequence[TopicPlan]) -> Iterator[Event]:
    """Yield every event; topics are merged by reception, and drained in blocks for speed."""
    read = bag.read([plan.topic for plan in plans])
    streams = [
        zip(read[plan.topic].received.tolist(), [k] * len(read[plan.topic]), read[plan.topic],
            strict=True)
        for k, plan in enumerate(plans)
        if plan.topic in read
    ]  # fmt: skip
    for count, (received, topic, data) in enumerate(heapq.merge(*streams, key=lambda m: m[0])):
        pipeline.push(topic, data, received)
        if count % 1000 == 999:
            yield from pipeline.advance()
    yield from pipeline.advance()


def _notes(plan: SignalPlan, recorded: Sequence[Published]) -> list[str]:
    """Return why the estimates cannot be equal, if they cannot."""
    if not recorded or not plan.by_reception:
        return []
    return [
        f'{plan.by_reception}: stamped by reception, of which recorder and identifier each have '
        'their own time; the estimates cannot be equal bit for bit'
    ]


def _beside(bag: Bag, node: str, config: MsgConfig) -> MsgConfig:
    """Return the msg_config in the namespace of the node, where the bag has topics of it there."""
    inside = replace(config, namespace=node.strip('/').rpartition('/')[0])
    relative = [s for s in config.all_sources() if not s.topic.startswith('/')]
    if config.namespace or not any(topic_of(bag, source, inside) for source in relative):
        return config
    return inside


def _plan(bag: Bag, given: Configuration, config: MsgConfig) -> SignalPlan:
    """Choose the topics, under the names and types that they have in the bag."""
    places = [(source, topic_of(bag, source, config)) for source in config.all_sources()]
    sources = [
        replace(source, topic=topic.name, type=topic.msgtype) if topic else source
        for source, topic in places
        if topic or source.derived
    ]
    try:
        return given.plan(sources, config.base_clock)
    except UserError as error:
        known = ', '.join(bag.topics) or 'no topics'
        raise UserError(f'{bag.path} has {known}: {error}') from None


def _readers(bag: Bag, plan: SignalPlan) -> list[TopicReader]:
    types = definitions(bag.topics[topic.topic] for topic in plan.topics)
    return [topic.reader(types) for topic in plan.topics]


def _published(bag: Bag, node: str, name: str) -> list[Published]:
    """Return what a node published on a topic of its own."""
    topic = find_topic(bag, f'{node}/{name}', '`--node {}/' + node + '`')
    return list(_diagnostics(bag, topic)) if topic else []


def _diagnostics(bag: Bag, topic: Topic) -> Iterator[Published]:
    store = get_typestore(Stores.ROS2_JAZZY)
    for _, _, data in bag.iterate([topic.name]):
        message = store.deserialize_cdr(data, DIAGNOSTICS)
        stamp = message.header.stamp  # type: ignore[attr-defined]
        statuses = {
            status.name: {pair.key: pair.value for pair in status.values}
            for status in message.status  # type: ignore[attr-defined]
        }
        yield Published(stamp.sec * 1_000_000_000 + stamp.nanosec, statuses)


def _texts(event: Event) -> Texts:
    """Return what the node would publish for this event."""
    return {
        status.name: {key: text_of(value) for key, value in status.values.items()}
        for status in estimate_statuses(event)
    }


def _compare(events: Sequence[Event], recorded: Sequence[Published]) -> Check:
    replayed = {(e.first_stamp, e.stamp): e for e in events if e.estimate is not None}
    compared = unreachable = 0
    for one in recorded:
        event = replayed.get((one.first_stamp, one.stamp))
        if event is None or event.digest != one.statuses['samples']['digest']:
            unreachable += 1
            continue
        compared += 1
        texts = _texts(event)
        if texts != one.statuses:
            return Check(compared, unreachable, _difference(one, texts))
    return Check(compared, unreachable)


def _difference(one: Published, texts: Texts) -> str:
    for name in sorted({*one.statuses, *texts}):
        live, again = one.statuses.get(name, {}), texts.get(name, {})
        for key in sorted({*live, *again}):
            if live.get(key) != again.get(key):
                return (
                    f'`{name}` {key} at stamp {one.stamp * 1e-9:.6f} s: '
                    f'live {live.get(key)}, replayed {again.get(key)}'
                )
    return ''
