"""The launch file without `launch`, which no wheel brings: nodes, arguments, parameters."""

from dataclasses import dataclass, field, fields
import importlib.util
from pathlib import Path
import sys
from types import ModuleType, SimpleNamespace

import pytest
import yaml

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from motor_sysid.control.tuning import current_pi, torque_constant
from motor_sysid.nodes.excitation import ExcitationSettings
from motor_sysid.nodes.identifier_settings import IdentifierSettings
from motor_sysid.nodes.motor_settings import MotorSettings, PARAMETERS
from motor_sysid.nodes.parameters import checked
from motor_sysid.nodes.pid import PidSettings
from motor_sysid.nodes.recorder import RecorderSettings

KINDS = {
    'motor': MotorSettings,
    'pid': PidSettings,
    'identifier': IdentifierSettings,
    'recorder': RecorderSettings,
    'excitation': ExcitationSettings,
}


@dataclass
class Argument:
    name: str
    default_value: str
    description: str


@dataclass
class Value:
    of: str
    value_type: object = None


@dataclass
class LaunchedNode:
    package: str
    executable: str
    name: str
    parameters: list[object]
    output: str
    condition: object = None
    given: dict[str, Value] = field(default_factory=dict)


@pytest.fixture
def description(repository: Path, monkeypatch: pytest.MonkeyPatch) -> list[object]:
    modules = {
        'ament_index_python': {},
        'ament_index_python.packages': {'get_package_share_path': lambda name: repository},
        'launch': {'LaunchDescription': list},
        'launch.actions': {'DeclareLaunchArgument': Argument},
        'launch.conditions': {'IfCondition': SimpleNamespace},
        'launch.substitutions': {'LaunchConfiguration': lambda name: name},
        'launch_ros': {},
        'launch_ros.actions': {'Node': LaunchedNode},
        'launch_ros.parameter_descriptions': {'ParameterValue': Value},
    }
    modules['launch.conditions']['IfCondition'] = lambda name: SimpleNamespace(of=name)
    for name, content in modules.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    path = repository / 'launch' / 'closed_loop.launch.py'
    spec = importlib.util.spec_from_file_location('closed_loop', path)
    assert spec is not None
    assert spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded.generate_launch_description()


def test_all_nodes_start_with_their_config_files(description: list[object]) -> None:
    found = {node.name: node for node in description if isinstance(node, LaunchedNode)}
    assert found.keys() == KINDS.keys()
    for name, node in found.items():
        assert (node.package, node.executable) == ('motor_sysid', name)
        file, of_motor, given = node.parameters
        assert Path(str(file)).is_file()
        assert all(Path(of_motor[0] + kind + of_motor[2]).is_file() for kind in PARAMETERS)
        assert isinstance(given, dict)
        assert given.keys() <= {item.name for item in fields(KINDS[name])}


def test_every_argument_is_used_and_its_default_fits(description: list[object]) -> None:
    arguments = {a.name: a for a in description if isinstance(a, Argument)}
    used = set()
    for node in description:
        if isinstance(node, LaunchedNode):
            if node.condition is not None:
                used.add(node.condition.of)  # type: ignore[attr-defined]
            given = node.parameters[2]
            assert isinstance(given, dict)
            used.add(node.parameters[1][1])
            for name, value in given.items():
                used.add(value.of)
                item = next(f for f in fields(KINDS[node.name]) if f.name == name)
                default: object = arguments[value.of].default_value.strip('[]')
                checked(item, float(str(default)) if value.value_type is float else default)
    assert used == arguments.keys()
    assert all(a.description for a in arguments.values())


@pytest.mark.parametrize('kind', PARAMETERS)
def test_the_file_of_a_motor_kind_fits_the_nodes_and_their_gains(
    kind: str, repository: Path
) -> None:
    content = yaml.safe_load((repository / 'config' / f'loop_{kind}.yaml').read_text())
    made = {}
    for key, tree in content.items():
        name = key.removeprefix('/**/')
        known = {item.name: item for item in fields(KINDS[name])}
        values = {n: checked(known[n], v) for n, v in tree['ros__parameters'].items()}
        made[name] = KINDS[name](**values)
    motor, pid, identifier = made['motor'], made['pid'], made['identifier']
    assert motor.motor_kind == identifier.motor == kind
    model = motor.base()
    pairs = [m['pole_pairs'] for m in (model, identifier.model()) if 'pole_pairs' in m.parameters]
    assert len(set(pairs)) <= 1
    if pid.command == 'current':
        gains = current_pi(model['J'], torque_constant(model), 25.0, pid.current_limit)
        assert (pid.kp, pid.ki) == pytest.approx((gains.kp, gains.ki), rel=0.05)
    speed_e = motor.pole_pairs * pid.top_speed
    assert kind != 'bldc' or speed_e / motor.rate < 0.25, 'phases turn little in a sample'
