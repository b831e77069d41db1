"""Every kind of method does the identifier's refits: the service, the worker, the result."""

from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from closed_loop import drive, DT, TRUE, true_motor
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter
from ros_harness import wait_for
from std_srvs.srv import Trigger

from motor_sysid.estimation.batch import METHODS
from motor_sysid.nodes.identifier import IdentifierNode
from motor_sysid.nodes.identifier_settings import REFIT_METHODS
from motor_sysid.nodes.long_work import LongWork
from motor_sysid.nodes.publishing import SECOND

NOMINAL = [f'{name}={1.4 * TRUE[name]!r}' for name in ('R', 'L', 'k_t', 'J', 'b')]
KINDS = ('pso', 'least_squares', 'prediction_error', 'huber', 'iv',
         'steiglitz_mcbride')  # fmt: skip
"""One of each kind."""

REFUSED = {
    'characteristic_points': 'held until the motor settled',
    'cpm_gwo': 'held until the motor settled',
    'delay_profiled': 'add the effect',
}
"""Those that a closed loop without a delay is not for, and what they ask for."""


@pytest.fixture
def identifier() -> Iterator[IdentifierNode]:
    context = Context()
    rclpy.init(context=context)
    given = {'nominal': NOMINAL}
    node = IdentifierNode(context, [Parameter(k, value=v) for k, v in given.items()])
    yield node
    node.close()
    node.destroy_node()
    rclpy.try_shutdown(context=context)


class Told:
    """A logger that keeps what failed."""

    def __init__(self) -> None:
        self.last = ''

    def warning(self, message: str) -> None:
        self.last = message


def fill(node: IdentifierNode) -> None:
    """Put 1.5 s of a controlled motor where the samples of the topics go."""
    rows = drive(true_motor(), 1.5, 0, 4096)
    wait_for(lambda: node._connect() or node._pipeline is not None, 'the plan')
    pipeline = node._pipeline
    assert pipeline is not None
    named = dict(zip(('voltage', 'current', 'speed', 'position'), rows.T[1:], strict=True))
    values = np.column_stack([named[name] for name in pipeline.signals])
    stamps = 5 * SECOND + (rows[:, 0] / DT).round().astype(np.int64) * (SECOND // 1000)
    pipeline.window.append(stamps, values, np.ones(len(rows), dtype=bool))


def test_each_kind_of_method_refits(identifier: IdentifierNode) -> None:
    fill(identifier)
    log = Told()
    identifier._work = work = LongWork(log)
    for method in (*KINDS, *REFUSED):
        work.fitted, log.last = None, ''
        assert identifier.set_parameters([Parameter('refit_method', value=method)])[0].successful
        said = identifier._on_refit(Trigger.Request(), Trigger.Response())
        assert said.success, said.message
        wait_for(lambda: work.poll().fitted or log.last, f'the refit by {method}')
        if method in REFUSED:
            assert log.last.startswith('refit failed: '), method
            assert REFUSED[method] in log.last
            continue
        assert work.fitted is not None, log.last
        assert work.fitted.success, method
        for name in ('R', 'k_t'):
            assert work.fitted.model[name] == pytest.approx(TRUE[name], rel=0.05), method


def test_what_needs_a_reference_is_not_offered_live(identifier: IdentifierNode) -> None:
    assert set(METHODS) - set(REFIT_METHODS) == {'two_stage'}
    result = identifier.set_parameters([Parameter('refit_method', value='two_stage')])[0]
    assert not result.successful
    assert 'two_stage' in result.reason
