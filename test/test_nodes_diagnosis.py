"""The live loop: diagnose on request, add what is missing, see the error fall, replay it all."""

from collections import deque
from collections.abc import Iterator
import math
from pathlib import Path
import re
import time

import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.srv import AddDiagnostics
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from ros_harness import nodes, parameters, wait_for
from std_srvs.srv import Trigger

from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.monitor import Monitor
from motor_sysid.nodes.publishing import LATCHED, SECOND, vector_publisher
from motor_sysid.nodes.replay import recorded_configurations, replay
from motor_sysid.recording.field_reader import FieldReader
from motor_sysid.recording.rosbag import Bag

JOINT, DIAGNOSTICS = 'sensor_msgs/msg/JointState', 'diagnostic_msgs/msg/DiagnosticArray'
RATE = 250
MOTOR = {'R': 2.0, 'L': 5e-3, 'k_t': 0.05, 'J': 5e-5, 'b': 2e-5}
LONG = 180.0
"""Patience for a diagnosis on a busy machine, s."""

LEVELS = (60.0, -60.0, 15.0, -15.0, 100.0, 0.0, -100.0, 30.0, -5.0, 5.0)
HOLD = 0.4
"""The reference in rad/s, s for each level: 4 s, over and over, so that errors can be compared."""

TURN = 200
"""Residuals published in that time."""

Statuses = dict[str, tuple[str, dict[str, str]]]
"""Status name to its message and its texts."""


class Watch:
    """Listens to an identifier and calls its services."""

    def __init__(self, node: Node) -> None:
        self.node, self.health, self.verdict, self.model = node, {}, {}, {}
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        few = QoSProfile(depth=500)
        self._residual = RawTopic(node, '/identifier/residual', JOINT, few)
        self._health = RawTopic(node, '/diagnostics', DIAGNOSTICS, few)
        self._verdict = RawTopic(node, '/identifier/diagnosis', DIAGNOSTICS, LATCHED)
        self._model = RawTopic(node, '/identifier/model', DIAGNOSTICS, LATCHED)
        self._read = FieldReader(JOINT, ('velocity[0]',)).read
        self._reference = vector_publisher(node, '/motor/reference', 'speed')
        self.errors: deque[float] = deque()

    def look(self) -> bool:
        """Take what has come."""
        self._executor.spin_once(timeout_sec=0)
        level = LEVELS[int(time.monotonic() / HOLD) % len(LEVELS)]
        self._reference.publish(time.time_ns(), level, 0.0, 0.0)
        self.errors.extend(float(self._read(m.data)[0]) for m in self._residual.drain())
        for topic, target in ((self._health, self.health), (self._model, self.model)):
            target.update(newest(topic))
        found = newest(self._verdict)
        self.verdict = found or self.verdict
        return True

    def wait(self, condition: object, what: str, patience: float = LONG) -> None:
        wait_for(lambda: self.look() and condition(), what, patience)  # type: ignore[operator]

    def rms(self, count: int) -> float:
        """Return the RMS of the next residuals of the speed, rad/s."""
        self.look()
        self.errors.clear()
        self.wait(lambda: len(self.errors) >= count, f'{count} residuals')
        values = [e for e in self.errors if math.isfinite(e)]
        return math.sqrt(sum(e * e for e in values) / len(values))

    def call(self, kind: type, service: str, **request: object) -> tuple[bool, str]:
        client = self.node.create_client(kind, f'/identifier/{service}')
        self.wait(client.service_is_ready, service)
        future = client.call_async(kind.Request(**request))
        self.wait(future.done, service)
        return future.result().success, future.result().message

    def set(self, node: str, **values: object) -> tuple[bool, str]:
        client = AsyncParameterClient(self.node, node)
        self.wait(client.services_are_ready, 'parameters')
        given = [Parameter(name, value=value) for name, value in values.items()]
        future = client.set_parameters_atomically(given)
        self.wait(future.done, f'parameters of {node}')
        result = future.result().result
        return result.successful, result.reason

    def set_effects(self, *effects: str) -> tuple[bool, str]:
        return self.set('/identifier', effects=list(effects) or [''])

    def lost(self) -> dict[str, str]:
        """Return the counts that are not zero of what went astray."""
        values = self.health.get('identifier: intake', ('', {}))[1]
        names = [n for n in values if n.startswith('lost')]
        names += ['missing', 'out_of_order', 'overflow', 'overrun']
        return {n: values[n] for n in names if values[n] != '0'}


def newest(topic: RawTopic) -> Statuses:
    """Return the statuses of the messages that have come, the newest of each name."""
    found: Statuses = {}
    for message in topic.drain():
        for status in deserialize_message(message.data, DiagnosticArray).status:
            found[status.name] = status.message, {p.key: p.value for p in status.values}
    return found


@pytest.fixture
def watch() -> Iterator[Watch]:
    context = Context()
    rclpy.init(context=context)
    node = rclpy.create_node('watch', context=context)
    yield Watch(node)
    node.destroy_node()
    rclpy.try_shutdown(context=context)


def running(bag: Path, motor: dict[str, object], **identifier: object) -> object:
    """Run a motor in a speed loop, its identifier and a recorder."""
    return nodes(
        motor=parameters(rate=RATE, **MOTOR, **motor),
        pid=parameters(),
        identifier=parameters(**identifier),
        recorder=parameters(path=bag),
    )


def check_verdict(watch: Watch) -> None:
    """Compare what is published of a motor that hides Coulomb friction."""
    summary, head = watch.verdict['verdict']
    assert head['verdict'] == 'effect_missing', summary
    assert head['effects'] == 'coulomb_friction'
    message, candidate = watch.verdict['candidate coulomb_friction']
    assert (message, candidate['passes']) == ('helps', 'True')
    assert float(candidate['delta_bic']) > 100
    assert float(candidate['tau_c.value']) > 5 * float(candidate['tau_c.sigma'])
    errors = [float(watch.verdict[f'step {k}'][1]['validation_error_percent']) for k in (0, 1)]
    assert errors[1] < errors[0]
    assert 'reason.1' in head
    watch.wait(lambda: summary in watch.health['identifier: diagnosis'][0], 'the summary')


def check_refusals(watch: Watch) -> None:
    for effects, remedy in (
        (('coulomb_friction', 'witchcraft'), 'unknown effect `witchcraft`'),
        (('coulomb_friction', 'load_torque_step'), '~/reset'),
        (('coulomb_friction', 'inductance_saturation'), 'estimator `ekf`'),
    ):
        done, why = watch.set_effects(*effects)
        assert not done
        assert re.search(remedy, why), why
    for service, key, why in (
        ('add_effect', 'coulomb_friction', 'the model has `coulomb_friction` already'),
        ('remove_effect', 'quadratic_drag', 'it has coulomb_friction'),
    ):
        done, told = watch.call(AddDiagnostics, service, load_namespace=key)
        assert not done
        assert why in told


@pytest.mark.timeout(400)
def test_what_is_missing_is_named_live_and_the_error_falls_when_it_is_added(
    watch: Watch, tmp_path: Path
) -> None:
    hidden = {'hidden_effects': '[coulomb_friction]'}
    with running(tmp_path / 'bag', hidden, diagnose_window=10.0) as processes:
        with Monitor() as monitor:
            monitor.wait_until_heard(lambda: None)
        assert watch.call(Trigger, 'reset')[0]
        watch.rms(2 * TURN)  # what the estimator learns in the beginning
        before = watch.rms(TURN)
        assert watch.call(Trigger, 'diagnose')[0]
        assert watch.call(Trigger, 'diagnose') == (False, 'a diagnosis runs already')
        watch.wait(lambda: watch.verdict, 'a verdict')
        check_verdict(watch)
        added, told = watch.call(AddDiagnostics, 'add_effect', load_namespace='coulomb_friction')
        assert added, told
        watch.wait(lambda: watch.model['configuration'][1]['since'] != '0', 'a changed model')
        assert watch.model['configuration'][1]['effects'] == 'coulomb_friction'
        watch.rms(TURN)  # the hand-over
        after = watch.rms(TURN)
        assert after < 0.5 * before
        check_refusals(watch)
        assert watch.set_effects() == (True, '')
        watch.wait(lambda: not watch.model['configuration'][1]['effects'], 'the old model')
        watch.rms(TURN)
        without = watch.rms(TURN)
        assert without > 1.2 * after  # the estimator makes up for some of it
        assert watch.lost() == {}
        for name in ('pid', 'motor', 'identifier', 'recorder'):
            assert processes[name].end() == 0, processes[name].output()
    check_replay(tmp_path / 'bag')


def check_replay(bag: Path) -> None:
    configurations = recorded_configurations(Bag(bag))
    assert [c.model.effects for c in configurations] == [(), ('coulomb_friction',), ()]
    assert configurations[1].model['coulomb_friction.tau_c'] > 0
    result = replay(bag)
    assert result.check is not None
    assert result.check.difference == ''
    assert result.check.compared > 100
    with_it = [e for e in result.estimates if 'coulomb_friction.tau_c' in (e.estimate or {})]
    assert with_it[0].stamp >= configurations[1].since > with_it[0].first_stamp


def newest_stamp(topic: RawTopic, last: int = 0) -> int:
    read = FieldReader(JOINT, ('header.stamp.sec', 'header.stamp.nanosec')).read
    while messages := topic.drain():
        seconds, nanoseconds = read(messages[-1].data)
        last = int(seconds) * SECOND + int(nanoseconds)
    return last


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_the_moment_of_a_change_is_told(watch: Watch, tmp_path: Path) -> None:
    speed = RawTopic(watch.node, '/motor/speed', JOINT)
    change = ['inertia_change.g=0.6', 'inertia_change.t_on=1e-6', 'inertia_change.rise=0.008']
    with running(tmp_path / 'bag', {}, diagnose_window=16.0):
        with Monitor() as monitor:
            monitor.wait_until_heard(lambda: None)
        assert watch.call(Trigger, 'reset')[0]
        watch.rms(2 * TURN + TURN // 4)  # 9 s
        before = newest_stamp(speed)
        done = watch.set(
            '/motor', hidden_effects=['inertia_change'], hidden_parameters=change
        )
        assert done == (True, '')
        after = newest_stamp(speed)
        watch.rms(2 * TURN - TURN // 4)  # 7 s
        assert watch.call(Trigger, 'diagnose')[0]
        watch.wait(lambda: watch.verdict, 'a verdict')
    head = watch.verdict['verdict'][1]
    reasons = [head[key] for key in sorted(head) if key.startswith('reason.')]
    told = [one for one in reasons if one.startswith('The model held until')]
    assert told, reasons
    assert before - 0.3 * SECOND < int(head['held_until_stamp']) < after + 0.6 * SECOND, told
    assert 'inertia' in told[0], told
