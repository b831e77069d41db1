"""A user's own effect takes part in the nodes, in their worker and in a replay."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
import time

import pytest

from motor_sysid.cli import main
from motor_sysid.errors import UserError
from motor_sysid.nodes.own_effects import add_effect_files
from motor_sysid.nodes.worker import Worker
from motor_sysid.physics.effects import catalogue, effect

pytest.importorskip('rclpy')
from diagnostic_msgs.srv import AddDiagnostics

from motor_sysid.nodes.identifier import IdentifierNode
from motor_sysid.nodes.motor import MotorNode

SLIP = '''
"""A belt that takes a torque with the root of the speed."""

import math

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='belt slip',
    equation='tau = -c omega / sqrt(|omega| + 1 rad/s)',
    symptom='The unexplained torque grows with the root of the speed.',
    reference='none',
    enters=Enters.MECHANICAL,
    amplitudes=(Amplitude('c', 'N m s^0.5/rad^0.5', 'slip', Scale.ROOT_SPEED, positive=True),),
)


def torque(omega: float, c: float) -> float:
    """Torque in N m."""
    return -c * omega / math.sqrt(abs(omega) + 1.0)
'''


@pytest.fixture
def own(tmp_path: Path) -> Iterator[str]:
    path = tmp_path / 'belt_slip.py'
    path.write_text(SLIP)
    yield str(path)
    catalogue().pop('belt_slip', None)


@dataclass(frozen=True)
class Asked:
    """A job that asks for an effect."""

    key: str

    def work(self) -> object:
        """Return its title."""
        return effect(self.key).card.title


def test_a_motor_hides_it_and_an_identifier_has_it(own: str, make_node: Callable) -> None:
    motor = make_node(MotorNode, effect_files=[own], hidden_effects=['belt_slip'])
    assert motor.settings.value.model().effects == ('belt_slip',)
    identifier = make_node(IdentifierNode, effect_files=[own], effects=['belt_slip'])
    assert identifier._configuration.model.effects == ('belt_slip',)


def test_one_that_cannot_be_compiled_is_refused_and_the_node_lives_on(
    tmp_path: Path, make_node: Callable
) -> None:
    path = tmp_path / 'tabled.py'
    path.write_text(SLIP.replace('return -c', 'return -TABLE[0] * c') + '\nTABLE = {0: 1.0}\n')
    node = make_node(IdentifierNode, effect_files=[str(path)])
    try:
        ask = AddDiagnostics.Request(load_namespace='tabled')
        answer = node._on_add(ask, AddDiagnostics.Response())
        assert not answer.success
        assert answer.message.startswith('no estimator can be made: TypingError: Untyped global')
        assert (node._next, node._effects()) == (None, ())
        ask.load_namespace = 'coulomb_friction'
        assert node._on_add(ask, AddDiagnostics.Response()).success
        assert node._effects() == ('coulomb_friction',)
        with pytest.raises(UserError, match='TABLE'):
            make_node(IdentifierNode, effect_files=[str(path)], effects=['tabled'])
    finally:
        catalogue().pop('tabled', None)


def test_the_worker_knows_it_too(own: str) -> None:
    worker = Worker([own])
    try:
        assert worker.submit(Asked('belt_slip'))
        end = time.monotonic() + 60
        while (done := worker.poll()) is None and time.monotonic() < end:
            time.sleep(0.01)
        assert done is not None
        assert done.outcome == 'belt slip'
    finally:
        worker.close()


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match='no effect file'):
        add_effect_files([str(tmp_path / 'none.py')])


def test_a_replay_takes_it(
    own: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['replay', str(tmp_path / 'no_bag'), '--effect-file', own]) == 2
    assert 'belt_slip' in catalogue()
    assert 'no_bag' in capsys.readouterr().err
