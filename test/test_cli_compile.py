"""`motor-sysid compile`, and what the node says while it compiles."""

import time

import pytest

from motor_sysid.cli import main


def test_it_compiles_for_a_motor(capsys):
    assert main(['compile', '--motor', 'brushed_dc', '--effect', 'coulomb_friction']) == 0
    assert 'brushed_dc: ready' in capsys.readouterr().out


@pytest.mark.parametrize(('given', 'said'), [
    (['--estimator', 'magic'], 'unknown estimator `magic`'),
    (['--motor', 'steam'], 'steam'),
    (['--estimator', 'sliding_mode'], 'add --effect'),
])  # fmt: skip
def test_what_is_not_there_is_refused(given, said, capsys):
    assert main(['compile', *given]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize('kind', ['pmsm', 'bldc', 'brushed_dc_reduced', 'mechanical_axis'])
def test_it_compiles_for_every_kind(kind):
    assert main(['compile', '--motor', kind, '--estimator', 'rls', '--estimator', 'ekf']) == 0


def test_the_identifier_says_that_it_compiles(monkeypatch, capfd):
    rclpy = pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')
    from motor_sysid.nodes import identifier
    from motor_sysid.nodes.configuration import Configuration

    monkeypatch.setattr(identifier, 'SILENCE', 0.0)
    monkeypatch.setattr(Configuration, 'warm_up', lambda self: time.sleep(1.0))
    context = rclpy.context.Context()
    rclpy.init(context=context)
    node = identifier.IdentifierNode(context)
    node.close()
    node.destroy_node()
    rclpy.try_shutdown(context=context)
    assert 'compiling for this motor' in capfd.readouterr().err
