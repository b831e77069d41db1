"""A path in a parameter may begin with ~: no shell has expanded it."""

from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from rclpy.context import Context
from rclpy.parameter import Parameter

from motor_sysid.control.profile import Profile
from motor_sysid.control.profile_file import save_profile
from motor_sysid.errors import UserError
from motor_sysid.nodes.excitation import ExcitationSettings
from motor_sysid.nodes.identifier_settings import IdentifierSettings
from motor_sysid.nodes.recorder import RecorderNode
from motor_sysid.nodes.topics import sources_of
from motor_sysid.physics.model import Model
from motor_sysid.physics.store import save_model
from motor_sysid.resources import shipped_file


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv('HOME', str(tmp_path))
    return tmp_path


def test_a_bag_is_recorded_there(context: Context, home: Path) -> None:
    node = RecorderNode(context, [Parameter('path', value='~/bags/one')])
    node.close()
    node.destroy_node()
    assert (home / 'bags' / 'one' / 'metadata.yaml').is_file()


def test_files_are_read_there(home: Path) -> None:
    model = Model.base('brushed_dc', {'R': 2.25, 'k_t': 0.05})
    save_model(model, home / 'model.yaml')
    assert IdentifierSettings(model_file='~/model.yaml').model()['R'] == 2.25
    shipped = shipped_file('msg_config', 'default')
    (home / 'own.yaml').write_text(shipped.read_text())
    own = sources_of(IdentifierSettings(msg_config='~/own.yaml').messages())
    assert own == sources_of(IdentifierSettings(msg_config='default').messages())
    save_profile(Profile('steps', 10.0, 2.0), home / 'steps.yaml')
    assert ExcitationSettings(profile='~/steps.yaml').plan()[0].duration == pytest.approx(2.0)


def test_the_home_of_nobody_is_refused_as_a_file_that_is_not_there() -> None:
    with pytest.raises(UserError, match='~nobody-at-all'):
        IdentifierSettings(model_file='~nobody-at-all/model.yaml').model()
