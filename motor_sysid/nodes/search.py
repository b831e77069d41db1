"""Find the topics to listen to: of several sources the first one that somebody publishes."""

from collections.abc import Collection, Sequence
from functools import partial
import time

from rclpy.node import Node

from motor_sysid.errors import UserError
from motor_sysid.nodes.configuration import Configuration
from motor_sysid.nodes.topics import SignalPlan, with_types
from motor_sysid.recording.sources import Source

PATIENCE = 5.0
"""Time in s after which another source is taken than the first one that the msg_config names."""

DISCOVERY = 2.0
"""Time in s in which topics are found that are there already."""


class Search:
    """Looks again and again for what the msg_config names, until it is known what to listen to.

    What nobody publishes is waited for, but where other sources, all of which are there, would do
    without it: then for `PATIENCE` only.

    Parameters
    ----------
    node:
        Its node.
    sources:
        Of the msg_config.
    base_clock:
        Signal whose stamps the samples are to have.

    Attributes
    ----------
    awaited:
        Topics that nobody publishes and that are waited for.
    """

    def __init__(self, node: Node, sources: Sequence[Source], base_clock: str) -> None:
        self._node, self._sources, self._base_clock = node, sources, base_clock
        self._since = self._awaited_since = time.monotonic()
        self._told: set[tuple[str, ...]] = set()
        self.awaited: tuple[str, ...] = ()

    def plan(self, configuration: Configuration) -> SignalPlan | None:
        """Return what to listen to; None as long as it is not known."""
        types = dict(self._node.get_topic_names_and_types())
        names = {s.topic: self._node.resolve_topic_name(s.topic) for s in self._sources if s.topic}
        there = {topic for topic, name in names.items() if self._node.count_publishers(name)}
        known = {topic: types[name][0] for topic, name in names.items() if name in types}
        sources = with_types(self._sources, known)
        plan = configuration.plan(sources, self._base_clock)
        missing = {topic: names[topic] for topic in plan.names if topic not in there}
        chosen = partial(self._chosen, configuration, sources)
        if chosen(names.keys() - missing) not in (plan, None):
            other = chosen(there)
            if other is None or not there.issuperset(other.names):
                self._since = time.monotonic()
            if other is None or time.monotonic() - self._since < PATIENCE:
                self._wait(tuple(missing.values()))
                return None
            self._tell(plan, other, ', '.join(missing.values()))
            plan = other
        self._wait(tuple(names[topic] for topic in plan.names if topic in plan.untyped))
        return None if self.awaited else plan

    def _chosen(
        self, configuration: Configuration, sources: Sequence[Source], there: Collection[str]
    ) -> SignalPlan | None:
        """Return what would be listened to if that was there; None if it is too little."""
        try:
            return configuration.plan(sources, self._base_clock, there)
        except UserError:
            return None

    @property
    def waiting(self) -> str:
        """What is waited for, in words."""
        it = 'it' if len(self.awaited) == 1 else 'them'
        return f'waiting for {", ".join(self.awaited)} (nobody publishes {it})'

    def _wait(self, topics: tuple[str, ...]) -> None:
        """Wait for topics; say so once, when they have not appeared for a while."""
        now = time.monotonic()
        if topics != self.awaited:
            self.awaited, self._awaited_since = topics, now
        elif topics and topics not in self._told and now - self._awaited_since >= DISCOVERY:
            self._told.add(topics)
            self._node.get_logger().warning(self.waiting)

    def _tell(self, plan: SignalPlan, other: SignalPlan, missing: str) -> None:
        """Say what is done without the topics that nobody publishes."""
        told = [
            f'`{source.signal}` is taken from {source.describe()}'
            for source in other.sources
            if source not in plan.sources
        ]
        left = [signal for signal in plan.signals if signal not in other.signals]
        told += [f'`{signal}` is left out' for signal in left]
        self._node.get_logger().warning(f'nobody publishes {missing}: {", ".join(told)}')
