"""Condition monitoring live: the estimator's numbers, the node's line on /diagnostics."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from sister_motors import DT, model_of, recorded, steps, TYPE

from motor_sysid.errors import UserError
from motor_sysid.estimation.online import OnlineIdentifier
from motor_sysid.nodes.condition import ConditionWatch, NAME
from motor_sysid.nodes.identifier_settings import IdentifierSettings
from motor_sysid.physics.store import save_model

SECOND = 1_000_000_000
INPUTS, OUTPUTS = ['voltage'], ['current', 'speed']


@pytest.fixture
def model_file(tmp_path: Path) -> str:
    sigmas = {name: 0.01 * value for name, value in TYPE.items()}
    save_model(model_of(TYPE).with_estimates({}, sigmas), tmp_path / 'good.yaml')
    return str(tmp_path / 'good.yaml')


def watched(model_file: str, factor: float) -> ConditionWatch:
    """Return the watch over a motor whose resistance is that many times the reference's."""
    rng = np.random.default_rng(0)
    record = recorded({**TYPE, 'R': factor * TYPE['R']}, steps(8.0, rng), rng)
    online = OnlineIdentifier(model_of(TYPE), 'rls', dt=DT, inputs=INPUTS, outputs=OUTPUTS)
    watch = ConditionWatch(IdentifierSettings(model_file=model_file, watch_period=2.0))
    u = np.column_stack([record[name] for name in INPUTS])
    y = np.column_stack([record[name] for name in OUTPUTS])
    for k in range(0, len(record), 500):
        part = slice(k, k + 500)
        online.update(record.time[part], u[part], y[part])
        stamp = round((5 + record.time[part][-1]) * SECOND)
        watch.note(SimpleNamespace(stamp=stamp, estimate=online.estimate()))
    return watch


def test_a_resistance_that_rose_is_a_warning_with_its_cause(model_file: str) -> None:
    (status,) = watched(model_file, 1.15).statuses()
    assert status.warn
    assert status.message.startswith('R +')
    assert 'a warmer winding' in status.message
    assert status.values['R.change_percent'] == pytest.approx(15, abs=2)
    assert status.values['looks'] == 3
    assert 'a warmer winding' in status.values['cause.1']


def test_a_good_motor_is_no_warning(model_file: str) -> None:
    (status,) = watched(model_file, 1.0).statuses()
    assert not status.warn
    assert status.message == 'no parameter has moved beyond chance'


def test_without_a_period_nothing_is_said_and_without_a_model_it_is_refused() -> None:
    assert ConditionWatch(IdentifierSettings()).statuses() == []
    with pytest.raises(UserError, match='model_file'):
        ConditionWatch(IdentifierSettings(watch_period=1.0))


def test_samples_that_begin_anew_are_looked_at_anew(model_file: str) -> None:
    watch = ConditionWatch(IdentifierSettings(model_file=model_file, watch_period=2.0))
    estimate = {'R': (TYPE['R'], 0.01, 'ohm', True)}
    for second, looks in ((100, 0), (101, 0), (102, 1), (5, 1), (6, 1), (7, 2)):
        watch.note(SimpleNamespace(stamp=second * SECOND, estimate=estimate))
        assert watch.statuses()[0].values['looks'] == looks


@pytest.fixture
def identifier(model_file: str) -> Iterator[object]:
    pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')
    import rclpy
    from rclpy.context import Context
    from rclpy.parameter import Parameter

    from motor_sysid.nodes.identifier import IdentifierNode

    own = Context()
    rclpy.init(context=own)
    given = {'msg_config': 'default', 'model_file': model_file, 'watch_period': 1.0}
    node = IdentifierNode(own, [Parameter(k, value=v) for k, v in given.items()])
    yield node
    node.close()
    node.destroy_node()
    rclpy.try_shutdown(context=own)


def test_the_node_publishes_the_line(
    identifier: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, published = identifier, []
    estimate = {'k_t': (0.8 * TYPE['k_t'], 1e-4, 'N m/A', True)}
    for second in (10, 11):
        node._ask_for_work(SimpleNamespace(stamp=second * SECOND, estimate=estimate))
    pipeline = SimpleNamespace(doubts=[], join=SimpleNamespace(clock=''))
    monkeypatch.setattr(node, '_pipeline', pipeline)
    health = SimpleNamespace(statuses=lambda noise: [])
    monkeypatch.setattr(node, '_health', health, raising=False)
    sink = SimpleNamespace(publish=lambda stamp, statuses: published.extend(statuses))
    monkeypatch.setattr(node, '_diagnostics', sink)
    node._next_look = 0.0
    node._look()
    (status,) = (one for one in published if one.name == f'identifier: {NAME}')
    assert status.warn
    assert 'demagnetised' in status.message
    monkeypatch.setattr(node, '_pipeline', None)
