"""Build motor_sysid: with colcon on a robot, with pip or `make setup` anywhere else."""

from pathlib import Path
import re

from setuptools import find_packages, setup

NAME = 'motor_sysid'
ROOT = Path(__file__).resolve().parent
VERSION = re.search(r"__version__ = '(.+)'", (ROOT / NAME / '__init__.py').read_text()).group(1)

# The wheels of rclpy exist for this platform alone; elsewhere everything but the nodes works.
WHEELS = "; sys_platform == 'linux' and platform_machine == 'x86_64'"


def shared(folder):
    """List (destination, files) for a folder that belongs into share/, as data_files wants it."""
    files = [p.relative_to(ROOT) for p in sorted((ROOT / folder).rglob('*')) if p.is_file()]
    files = [p for p in files if '__pycache__' not in p.parts]
    return [(f'share/{NAME}/{p.parent}', [str(p)]) for p in files]


setup(
    name=NAME,
    version=VERSION,
    description='Online identification of perturbed motors: compare, diagnose, add the effect',
    long_description=(ROOT / 'README.md').read_text(),
    long_description_content_type='text/markdown',
    license='Apache-2.0',
    maintainer='The motor_sysid maintainers',
    maintainer_email='maintainers@motor-sysid.example',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={NAME: ['py.typed'], f'{NAME}.workbench': ['assets/**/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        *shared('config'),
        *shared('launch'),
        *shared('msg_config'),
    ],
    zip_safe=False,
    python_requires='>=3.11',
    install_requires=[
        'filterpy>=1.4.5',
        'numba>=0.59',
        'numpy>=1.26',
        'PyYAML>=6.0',
        'rich>=13.0',
        'rosbags>=0.11,<0.12',
        'scipy>=1.11',
    ],
    extras_require={
        # rclpy and its messages from wheels, for a machine without ROS.  Never beside /opt/ros.
        'ros': [
            f'ros-rclpy[fastrtps]==7.1.6{WHEELS}',
            f'ros-jazzy-common-interfaces==5.3.6{WHEELS}',
        ],
        # A peer that `motor-sysid benchmark` compares with, where it is there.
        'bench': ['pysindy>=2.0'],
        'test': [
            'hypothesis',
            'mujoco>=3.1,<4',
            'playwright',
            'pytest>=7.4',
            'pytest-timeout>=2.2',
        ],
        'dev': [
            'colcon-bash',
            'colcon-core',
            'colcon-recursive-crawl',
            'colcon-ros',
            'colcon-test-result',
            'mypy',
            'pytest-xdist',
            'ruff',
            'scipy-stubs',
            'setuptools<80',  # what colcon-core asks for
            'types-PyYAML',
        ],
    },
    entry_points={
        'console_scripts': [
            'motor-sysid = motor_sysid.cli:main',
            'motor = motor_sysid.nodes.motor:main',
            'pid = motor_sysid.nodes.pid:main',
            'identifier = motor_sysid.nodes.identifier:main',
            'recorder = motor_sysid.nodes.recorder:main',
            'excitation = motor_sysid.nodes.excitation:main',
        ],
        # The group `motor_sysid.effects` is reserved for effects of other packages.
    },
)
