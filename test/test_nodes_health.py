"""What /diagnostics says of the intake: what goes wrong now, by topic, and whose intake it is."""

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from rclpy.context import Context
from rclpy.parameter import Parameter
from test_nodes_pipeline import joint, pipeline, vector

from motor_sysid.nodes.excitation import ExcitationNode
from motor_sysid.nodes.health import Health, Rhythm
from motor_sysid.nodes.identifier import IdentifierNode
from motor_sysid.nodes.loop import LoopNode
from motor_sysid.nodes.recorder import RecorderNode

STEP = 2_000_000
TOPICS = ('/motor/voltage', '/motor/current', '/motor/speed')


class Intake:
    """A pipeline and its health, given samples by number."""

    def __init__(self) -> None:
        self.pipeline = pipeline()
        self.topics = [SimpleNamespace(resolved=t, received=0, lost=0) for t in TOPICS]
        self.health = Health(self.pipeline, self.topics)

    def take(
        self, numbers: Sequence[int], topics: Sequence[int] = (0, 1, 2), late: int = 0
    ) -> tuple[str, bool]:
        """Take samples on some topics, the speed `late` ns after the others; say how it went."""
        for k in numbers:
            speed = joint(k * STEP + late, [], [], [1.0])
            data = vector(k * STEP, 1.0), vector(k * STEP, 2.0), speed
            for topic in topics:
                self.pipeline.push(topic, data[topic], 0)
                self.topics[topic].received += 1
        self.pipeline.advance()
        return self.report()

    def report(self) -> tuple[str, bool]:
        self.status, _ = self.health.statuses({})
        return self.status.message, self.status.warn


def test_all_is_well_from_the_first_samples_on() -> None:
    intake = Intake()
    assert intake.take(range(10)) == ('ok', False), 'the sample time is not known yet'
    assert intake.take(range(10, 500)) == ('ok', False)


def test_a_topic_whose_messages_lack_the_signals_is_named() -> None:
    intake = Intake()
    for k in range(10):
        intake.pipeline.push(2, joint(k * STEP, ['wrist'], [], []), 0)
    for topic in intake.topics:
        topic.received += 10
    message = 'no message of /motor/speed has `velocity[0]` or `position[0]`'
    assert intake.report() == (message, True)
    assert intake.status.values['foreign'] == 10


@pytest.mark.parametrize('heard', [(0, 1), (0, 2), (2,), ()])
def test_a_topic_that_is_silent_is_named(heard: tuple[int, ...]) -> None:
    silent = ', '.join(TOPICS[k] for k in range(3) if k not in heard)
    intake = Intake()
    assert intake.take(range(100), heard) == (f'nothing heard of {silent}', True), 'from the start'
    assert intake.take(range(100, 200)) == ('ok', False)
    assert intake.take(range(200, 300), heard) == (f'nothing heard of {silent}', True)


def test_a_topic_that_speaks_seldom_is_silent_only_after_long() -> None:
    """A battery that is heard every other second, and then no more."""
    rhythm = Rhythm()
    silent = [t for t in range(20) if rhythm.is_silent(float(t), int(t % 2 == 1 and t < 10))]
    assert silent == [0, 2, *range(14, 20)], 'at 2 s it is not known yet how often it speaks'


def test_stamps_that_never_meet_are_told() -> None:
    message, warn = Intake().take(range(100), late=3600_000_000_000)
    assert warn
    assert message.startswith('no sample is complete: the stamps of the topics have no time in')


def test_stamps_that_differ_are_none_of_a_fault() -> None:
    """The rows are those of the topic that drives; the others are known in between."""
    intake = Intake()
    assert intake.take(range(100), late=STEP // 3) == ('ok', False)
    assert intake.status.values['clock'] == 'motor/voltage'


def test_how_rows_are_made_is_told_when_it_is_known() -> None:
    intake = Intake()
    intake.take(range(2))
    assert intake.status.values['clock'] == 'not known yet'
    intake.take(range(2, 100))
    assert intake.status.values['clock'] == 'equal stamps'


def test_a_loss_is_over_when_it_is_over() -> None:
    intake = Intake()
    intake.take(range(100))
    intake.topics[1].lost += 3
    assert intake.take(range(100, 200)) == ('samples were lost', True)
    assert intake.take(range(200, 300)) == ('ok', False)
    assert intake.take([*range(300, 350), *range(353, 400)]) == ('samples were lost', True)
    assert intake.take([*range(401, 450), *range(480, 500)]) == ('samples were lost', True)
    assert intake.take(range(500, 600)) == ('ok', False)
    values = intake.status.values
    assert (values['lost /motor/current'], values['missing']) == (3, 34), 'counts are totals'


def test_one_long_gap_is_a_pause() -> None:
    intake = Intake()
    intake.take(range(100))
    assert intake.report() == (f'nothing heard of {", ".join(TOPICS)}', True)
    assert intake.take(range(1600, 1700)) == ('paused for 3 s', False)
    assert intake.take(range(1700, 1800)) == ('ok', False)


@pytest.mark.parametrize(
    ('kind', 'names'),
    [
        (IdentifierNode, {'identifier: intake', 'identifier: model', 'identifier: diagnosis'}),
        (RecorderNode, {'recorder'}),
        (ExcitationNode, {'excitation'}),
    ],
)
def test_statuses_bear_the_namespace_of_their_node(
    context: Context, monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
    kind: type[LoopNode], names: set[str],
) -> None:  # fmt: skip
    given = {'path': str(tmp_path / 'bag')} if kind is RecorderNode else {}
    node = kind(context, [Parameter(n, value=v) for n, v in given.items()])
    try:
        assert names_of(node, monkeypatch) == names
        monkeypatch.setattr(node, 'get_fully_qualified_name', lambda: f'/left/{node.get_name()}')
        assert names_of(node, monkeypatch) == {f'left/{name}' for name in names}
    finally:
        node.close()
        node.destroy_node()


def names_of(node: LoopNode, monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Return what the statuses of its next report are called."""
    told: list[str] = []
    sink = SimpleNamespace(publish=lambda stamp, found: told.extend(s.name for s in found))
    monkeypatch.setattr(node, '_diagnostics', sink)
    node._next_look = node._next_report = 0.0
    node.step()
    return set(told)
