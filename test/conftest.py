"""What every test shares: a ROS of its own, the real data, a browser."""

from collections.abc import Callable, Iterator
import os
from pathlib import Path
import shutil
import tempfile
from typing import TYPE_CHECKING

from motor_sysid.threads import use_one

use_one()  # before anything imports numpy, and for every program that a test starts

import hypothesis  # noqa: E402
import pytest  # noqa: E402

if TYPE_CHECKING:
    from playwright.sync_api import Browser
    from rclpy.context import Context
    from rclpy.node import Node

    from motor_sysid.nodes.loop import LoopNode

pytest_plugins = ['workers']

ROOT = Path(__file__).resolve().parent.parent

# Before anything imports rclpy.  A test must never reach a real robot: whatever domain the shell
# has, tests take another one on this machine alone; 1 to 101 are the domains free of other ports.
_LOG_DIRECTORY = tempfile.mkdtemp(prefix='motor_sysid_test_ros_')
os.environ.update(
    ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST',
    ROS_DOMAIN_ID=str(1 + os.getpid() % 101),
    ROS_LOG_DIR=_LOG_DIRECTORY,
    ROS_PYTHON_CHECK_FIELDS='1',  # off by default: an int in a float field would publish garbage
)
os.environ.pop('ROS_LOCALHOST_ONLY', None)

hypothesis.settings.register_profile('repeatable', derandomize=True, deadline=None)
hypothesis.settings.load_profile('repeatable')


def pytest_unconfigure() -> None:
    """Remove the log files of the nodes that ran."""
    shutil.rmtree(_LOG_DIRECTORY, ignore_errors=True)


@pytest.fixture(scope='session')
def repository() -> Path:
    """Return the root of the source tree."""
    return ROOT


@pytest.fixture(scope='session')
def data_dir() -> Path:
    """Return the directory of real motor data, or skip: it is no part of the repository."""
    directory = Path(os.environ.get('MOTOR_SYSID_DATA', ROOT.parent / 'shared' / 'data'))
    if not directory.is_dir():
        pytest.skip(f'no real data in {directory}; set MOTOR_SYSID_DATA to its directory')
    return directory


@pytest.fixture(scope='module')
def chromium() -> 'Iterator[Browser]':
    """Return a headless Chromium, or skip where there is none."""
    playwright = pytest.importorskip('playwright.sync_api')
    found = shutil.which('chromium') or shutil.which('chromium-browser')
    if found is None:
        pytest.skip('no chromium; on Debian: sudo apt install chromium')
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=found, args=['--no-sandbox'])
        yield browser
        browser.close()


@pytest.fixture
def context() -> 'Iterator[Context]':
    """Return a ROS of its own."""
    rclpy = pytest.importorskip('rclpy')
    own = rclpy.context.Context()
    rclpy.init(context=own)
    yield own
    rclpy.try_shutdown(context=own)


@pytest.fixture
def other(context: 'Context') -> 'Iterator[Node]':
    """Return a node to speak to others with."""
    rclpy = pytest.importorskip('rclpy')
    node = rclpy.create_node('other', context=context)
    yield node
    node.destroy_node()


@pytest.fixture
def make_node(context: 'Context') -> 'Iterator[Callable[..., LoopNode]]':
    """Return what makes nodes, which are let go of even if the test fails."""
    rclpy = pytest.importorskip('rclpy')
    made: list[LoopNode] = []

    def build(kind: 'type[LoopNode]', **given: object) -> 'LoopNode':
        overrides = [rclpy.parameter.Parameter(name, value=v) for name, v in given.items()]
        made.append(kind(context, overrides))
        return made[-1]

    yield build
    for node in made:
        node.destroy_node()
