"""A colcon workspace gets everything that ROS tools and users look for."""

import os
from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parent.parent
EXECUTABLES = {'excitation', 'identifier', 'motor', 'motor-sysid', 'pid', 'recorder'}


@pytest.fixture(scope='module')
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the prefix of the package after a real `colcon build`."""
    pytest.importorskip('colcon_core', reason='colcon is not installed')
    pytest.importorskip('colcon_ros', reason='colcon is not installed')
    space = tmp_path_factory.mktemp('workspace')
    command = [
        sys.executable, '-m', 'colcon', '--log-base', str(space / 'log'),
        'build', '--base-paths', str(ROOT), '--packages-select', 'motor_sysid',
        '--build-base', str(space / 'build'), '--install-base', str(space / 'install'),
    ]  # fmt: skip
    done = subprocess.run(command, cwd=space, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return space / 'install' / 'motor_sysid'


def in_workspace(workspace: Path, command: str) -> str:
    """Run a shell command with the workspace sourced, outside the source tree."""
    script = f'. {workspace.parent}/setup.sh && {command}'
    environment = {k: v for k, v in os.environ.items() if not k.startswith(('AMENT', 'COLCON'))}
    environment['PATH'] = f'{Path(sys.executable).parent}{os.pathsep}{environment["PATH"]}'
    environment.pop('PYTHONPATH', None)
    done = subprocess.run(
        ['bash', '-c', script],
        cwd=workspace, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_executables_are_where_ros2_run_looks(workspace: Path) -> None:
    assert {p.name for p in (workspace / 'lib' / 'motor_sysid').iterdir()} == EXECUTABLES


def test_shared_files_are_installed(workspace: Path) -> None:
    share = workspace / 'share'
    assert (share / 'ament_index/resource_index/packages/motor_sysid').is_file()
    for folder in ('config', 'launch', 'msg_config'):
        for source in (ROOT / folder).rglob('*.*'):
            if '__pycache__' not in source.parts:
                installed = share / 'motor_sysid' / source.relative_to(ROOT)
                assert installed.read_bytes() == source.read_bytes()


def test_assets_of_the_page_are_installed(workspace: Path) -> None:
    assets = ROOT / 'motor_sysid' / 'workbench' / 'assets'
    (package,) = workspace.glob('lib/python3*/site-packages/motor_sysid')
    for source in assets.rglob('*.*'):
        assert (package / source.relative_to(ROOT / 'motor_sysid')).is_file()


def test_the_command_runs_from_the_workspace(workspace: Path) -> None:
    assert 'diagnose' in in_workspace(workspace, f'{workspace}/lib/motor_sysid/motor-sysid --help')


def test_an_installed_package_finds_its_own_files(workspace: Path) -> None:
    code = 'from motor_sysid.resources import shipped_file as f; print(f("msg_config", "emps"))'
    found = in_workspace(workspace, f"python3 -c '{code}'")
    assert found == str(workspace / 'share/motor_sysid/msg_config/emps.yaml')
