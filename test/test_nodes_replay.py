"""Replay of bags with several motors: never the topics of two of them."""

from collections.abc import Mapping
from dataclasses import replace
import math
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from test_nodes_pipeline import JOINT, joint, VECTOR, vector

from motor_sysid.cli import main
from motor_sysid.errors import UserError
from motor_sysid.nodes.identifier_settings import IdentifierSettings
from motor_sysid.nodes.publishing import pack_diagnostics
from motor_sysid.nodes.replay import DIAGNOSTICS, recorded_configuration, replay
from motor_sysid.nodes.statuses import Status
from motor_sysid.nodes.topics import DEFAULT_CONFIG
from motor_sysid.physics.store import dump_model
from motor_sysid.recording import load, load_msg_config
from motor_sysid.recording.rosbag import Bag
from motor_sysid.recording.writer import BagWriter

STEP, TURN = 2_000_000, 1e8
"""Time between two samples, and in which the motor turns to and fro by a radian, ns."""

SHIFTED = (
    ('right', 'voltage'), ('left', 'voltage'), ('left', 'current'), ('right', 'current'),
    ('right', 'speed'), ('left', 'speed'),
)  # fmt: skip
"""Topics in an order in which the first of each signal would be of two motors."""

NAMESPACE = """
namespace: left
signals:
  voltage: {topic: motor/voltage, field: vector.x}
  current: {topic: motor/current, field: vector.x}
  speed: {topic: motor/speed, field: 'velocity[0]'}
"""


def messages(of: float, stamp: int) -> Mapping[str, bytes]:
    """Return a sample of a motor whose voltage has the factor `of`."""
    wave = math.sin(stamp / TURN)
    return {
        'voltage': vector(stamp, of * 6 * wave),
        'current': vector(stamp, 0.3 * wave),
        'speed': joint(stamp, ['m'], [], [40 * wave]),
    }


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Two motors that differ in the voltage, each with an identifier of its own."""
    motors = {'left': 1.0, 'right': -2.0}
    with BagWriter(tmp_path / 'bag') as writer:
        for place, signal in SHIFTED:
            writer.add_topic(f'/{place}/motor/{signal}', JOINT if signal == 'speed' else VECTOR)
        for place, of in motors.items():
            writer.add_topic(f'/{place}/identifier/model', DIAGNOSTICS)
            given = IdentifierSettings(nominal=(f'R={3 + of!r}',)).configuration()
            status = Status('configuration', given.to_texts())
            model = pack_diagnostics(0, f'/{place}/identifier', [status])
            writer.write(f'/{place}/identifier/model', 0, model)
        for k in range(600):
            for place, of in motors.items():
                for signal, data in messages(of, STEP * (k + 1)).items():
                    writer.write(f'/{place}/motor/{signal}', STEP * (k + 1), data)
    return tmp_path / 'bag'


@pytest.fixture
def left(tmp_path: Path) -> Path:
    (tmp_path / 'left.yaml').write_text(NAMESPACE)
    return tmp_path / 'left.yaml'


def test_a_bag_with_two_motors_is_refused_as_load_does(bag: Path) -> None:
    configuration = IdentifierSettings().configuration()
    with pytest.raises(UserError, match='several topics for `motor/voltage`') as refused:
        replay(bag, configuration)
    assert '`namespace: /right` in a msg_config file' in str(refused.value)
    with pytest.raises(UserError) as again:
        load(bag)
    assert str(again.value) == str(refused.value)
    with pytest.raises(UserError, match='choose one with `--node /left/identifier`'):
        replay(bag)


def digest(bag: Path, **given: object) -> str:
    """Replay; return the digest of what the estimator was given."""
    result = replay(bag, IdentifierSettings().configuration(), **given)
    assert result.samples == 600
    assert result.dropped == 0
    return result.estimates[-1].digest


def test_the_namespace_says_which_motor(bag: Path, left: Path) -> None:
    config = load_msg_config(left)
    ours = digest(bag, msg_config=config)
    assert ours == digest(bag, node='left/identifier')
    assert ours == digest(bag, msg_config=config, node='right/identifier'), 'the file goes first'
    assert ours != digest(bag, node='/right/identifier')
    for name, resistance in (('left', 4.0), ('right', 1.0)):
        assert recorded_configuration(Bag(bag), f'{name}/identifier').model['R'] == resistance


def test_the_command_takes_both(bag: Path, left: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['replay', str(bag)]) == 2
    assert '--node /left/identifier' in capsys.readouterr().err
    assert main(['replay', str(bag), '--node', 'right/identifier']) == 0
    assert capsys.readouterr().out.startswith('600 samples')
    given = ['--msg-config', str(left), '--estimator', 'rls', '--node', 'right/identifier']
    assert main(['replay', str(bag), *given]) == 0


def test_a_model_of_ones_own_takes_no_estimator_where_several_were_recorded(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'model.yaml').write_text(dump_model(IdentifierSettings().configuration().model))
    given = ['replay', str(bag), '--model', str(tmp_path / 'model.yaml')]
    assert main(given) == 2
    assert '--node /left/identifier' in capsys.readouterr().err
    assert main([*given, '--node', 'left/identifier']) == 0


def test_a_signal_that_the_bag_lacks_is_named_with_what_it_has(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag') as writer:
        writer.add_topic('/arm/motor/voltage', VECTOR)
    with pytest.raises(UserError, match='has /arm/motor/voltage: no topic carries `speed` or'):
        replay(tmp_path / 'bag', IdentifierSettings().configuration())


def test_that_times_of_reception_differ_is_told(bag: Path, tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'checked') as writer:
        for place, signal in SHIFTED:
            if place == 'left':
                writer.add_topic(f'/motor/{signal}', JOINT if signal == 'speed' else VECTOR)
        writer.add_topic('/identifier/estimate', DIAGNOSTICS)
        status = Status('samples', {'samples': 1, 'first_stamp': STEP, 'digest': ''})
        data = pack_diagnostics(STEP, '/identifier', [status])
        writer.write('/identifier/estimate', STEP, data)
        for k in range(100):
            for signal, data in messages(1.0, STEP * (k + 1)).items():
                writer.write(f'/motor/{signal}', STEP * (k + 1), data)
    config = load_msg_config('default')
    sources = {n: tuple(replace(s, stamp='receive') for s in o) for n, o in config.sources.items()}
    configuration = IdentifierSettings().configuration()
    (note,) = replay(
        tmp_path / 'checked', configuration, replace(config, sources=sources)
    ).notes
    assert 'stamped by reception, of which recorder and identifier each have their own' in note
    assert not replay(tmp_path / 'checked', configuration).notes


def test_the_default_topics_are_those_of_the_shipped_file() -> None:
    shipped = {(s.signal, s.topic, s.field) for s in load_msg_config('default').all_sources()}
    assert {(s.signal, s.topic, s.field) for s in DEFAULT_CONFIG.all_sources()} <= shipped
