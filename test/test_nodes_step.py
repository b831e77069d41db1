"""A step of the identifier is short whatever waits, and nothing is lost for that."""

from collections.abc import Callable, Iterator
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_harness import wait_for
from std_srvs.srv import Trigger

from motor_sysid.nodes.identifier import IdentifierNode, MOST_WAITING, TAKEN
from motor_sysid.nodes.publishing import joint_publisher, SECOND, vector_publisher

COUNT = 400
BUDGET = 1e-4


@pytest.fixture
def identifier(context: Context) -> Iterator[IdentifierNode]:
    given = {'msg_config': 'default', 'time_budget': BUDGET, 'estimator': 'rls'}
    node = IdentifierNode(context, [Parameter(k, value=v) for k, v in given.items()])
    yield node
    node.close()
    node.destroy_node()


def sender(other: Node, identifier: IdentifierNode) -> Callable[[int, int], None]:
    """Return what publishes samples of these numbers at 1 kHz, all before the identifier looks."""
    volts = vector_publisher(other, 'motor/voltage', 'dc')
    amperes = vector_publisher(other, 'motor/current', 'dc')
    speed = joint_publisher(other, 'motor/speed', 'motor', ('position', 'velocity'))
    wait_for(lambda: identifier.step() or identifier._pipeline is not None, 'the topics')
    wait_for(lambda: all(t.publishers for t in identifier._topics), 'a match')

    def send(start: int, stop: int) -> None:
        for k in range(start, stop):
            wave = 1.0 if k // 50 % 2 else -1.0
            volts.publish(stamp(k), 6.0 * wave, 0.0, 0.0)
            amperes.publish(stamp(k), 0.3 * wave + 0.001 * (k % 7), 0.0, 0.0)
            speed.publish(stamp(k), 0.01 * k, 40.0 * wave + 0.1 * (k % 5))

    return send


def stamp(k: int) -> int:
    """Return the stamp of that sample, ns."""
    return 5 * SECOND + k * SECOND // 1000


def test_a_backlog_is_worked_off_in_short_steps(
    other: Node, identifier: IdentifierNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    sender(other, identifier)(0, COUNT)
    pipeline, budgets, sent = identifier._pipeline, [], []
    advance, post = pipeline.advance, identifier._post
    monkeypatch.setattr(
        pipeline, 'advance', lambda budget: budgets.append(budget) or advance(budget)
    )

    def counted(event: object) -> None:
        """Have every message that an event lines up say when it goes."""
        first = len(identifier._outbox)
        post(event)
        for k in range(first, len(identifier._outbox)):
            sending = identifier._outbox[k]
            identifier._outbox[k] = lambda s=sending: sent.append(1) or s()

    monkeypatch.setattr(identifier, '_post', counted)
    lined_up = 0

    def step() -> bool:
        nonlocal lined_up
        taken = [topic.received for topic in identifier._topics]
        waiting, gone = len(identifier._outbox), len(sent)
        identifier.step()
        now = [topic.received for topic in identifier._topics]
        assert all(b - a <= TAKEN for a, b in zip(taken, now, strict=True))
        left = len(identifier._outbox)
        assert left <= max(MOST_WAITING, waiting)
        lined_up += left - waiting + len(sent) - gone
        if left < MOST_WAITING:
            assert len(sent) - gone <= 1
        return min(now) == COUNT and not identifier.hurry and not left

    wait_for(step, 'all samples')
    assert set(budgets) == {BUDGET}
    assert [topic.lost for topic in identifier._topics] == [0, 0, 0]
    assert len(pipeline.window) == COUNT
    assert pipeline.overrun == 0
    assert len(sent) == lined_up > 2 * MOST_WAITING


def test_while_work_waits_the_next_step_is_due_at_once(
    other: Node, identifier: IdentifierNode
) -> None:
    sender(other, identifier)(0, COUNT)
    wait_for(lambda: identifier.step() or identifier._topics[0].received, 'the first')
    steps = []
    while identifier.hurry:
        identifier.step()
        steps.append(1)
    assert len(identifier._pipeline.window) > 1
    assert len(steps) > COUNT / TAKEN / 4


def test_what_came_before_a_reset_is_not_its_first_sample(
    other: Node, identifier: IdentifierNode
) -> None:
    send = sender(other, identifier)
    send(0, 100)
    wait_for(lambda: identifier.step() or len(identifier._pipeline.window), 'the first')
    assert identifier._pipeline.stream.first_stamp == stamp(0)

    def left_out() -> bool:
        assert identifier._on_reset(Trigger.Request(), Trigger.Response()).success
        return all(topic.received == 100 for topic in identifier._topics)

    wait_for(left_out, 'what is under way')
    assert not len(identifier._pipeline.window)
    send(100, 200)
    wait_for(lambda: identifier.step() or len(identifier._pipeline.window) == 100, 'the rest')
    assert identifier._pipeline.stream.first_stamp == stamp(100)


def test_more_messages_than_may_wait_go_at_once(identifier: IdentifierNode) -> None:
    sent: list[int] = []
    identifier._outbox.extend([lambda k=k: sent.append(k) for k in range(20)])
    identifier._send(MOST_WAITING)
    assert sent == list(range(20 - MOST_WAITING))
    identifier._send(MOST_WAITING)
    assert len(sent) == 20 - MOST_WAITING + 1
    identifier._send(0)
    assert sent == list(range(20))


def test_the_false_alarm_rate_goes_to_the_job(identifier: IdentifierNode) -> None:
    from motor_sysid.nodes.long_work import _job

    record = SimpleNamespace(duration=2.0)
    window = SimpleNamespace(last=lambda: ([9 * SECOND], None))
    stream = SimpleNamespace(first_stamp=3 * SECOND, estimate=dict)
    pipeline = SimpleNamespace(record=lambda seconds: record, window=window, stream=stream)
    identifier.set_parameters([Parameter('diagnose_alpha', value=0.2)])
    settings = identifier.settings.value
    job = _job('diagnosis', pipeline, identifier._configuration, settings)
    assert (job.alpha, job.first_stamp, job.offset) == (0.2, 7 * SECOND, 4.0)
