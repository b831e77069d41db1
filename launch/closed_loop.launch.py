"""The whole loop: motor, pid, identifier and recorder; and an experiment if asked for.

ros2 launch motor_sysid closed_loop.launch.py hidden_effects:="[coulomb_friction]" record:=false
ros2 launch motor_sysid closed_loop.launch.py motor:=pmsm
ros2 launch motor_sysid closed_loop.launch.py profile:=topic excite:=true excitation:=next.yaml
"""

from typing import List  # noqa: UP035

from ament_index_python.packages import get_package_share_path
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

PACKAGE = 'motor_sysid'


def generate_launch_description():
    config = get_package_share_path(PACKAGE) / 'config'

    def node(name, condition=None, **parameters):
        return Node(
            package=PACKAGE,
            executable=name,
            name=name,
            parameters=[
                str(config / f'{name}.yaml'),
                [str(config / 'loop_'), LaunchConfiguration('motor'), '.yaml'],
                parameters,
            ],
            output='screen',
            condition=condition,
        )

    def argument(name, kind):
        return ParameterValue(LaunchConfiguration(name), value_type=kind)

    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'motor', default_value='brushed_dc', description='brushed_dc, pmsm or bldc'
            ),
            DeclareLaunchArgument('rate', default_value='500.0', description='samples per second'),
            DeclareLaunchArgument(
                'hidden_effects',
                default_value='[coulomb_friction, cogging_torque]',
                description='effects that the motor has and its model lacks',
            ),
            DeclareLaunchArgument(
                'effect_files',
                default_value="['']",
                description='Python files with effects of your own',
            ),
            DeclareLaunchArgument('profile', default_value='mixed', description='speed profile'),
            DeclareLaunchArgument(
                'excite', default_value='false', description='run the node excitation, too'
            ),
            DeclareLaunchArgument(
                'excitation', default_value='steps', description='its profile: file or name'
            ),
            DeclareLaunchArgument(
                'estimator', default_value='rls', description='how the identifier estimates'
            ),
            DeclareLaunchArgument(
                'refit_period', default_value='0.0', description='refit this often, s; 0: never'
            ),
            DeclareLaunchArgument(
                'diagnose_period', default_value='0.0', description='diagnose this often, s'
            ),
            DeclareLaunchArgument('record', default_value='true', description='record a bag'),
            DeclareLaunchArgument('bag', default_value='', description='folder of the bag'),
            node(
                'motor',
                rate=argument('rate', float),
                # launch knows List[str], not list[str]
                effect_files=argument('effect_files', List[str]),  # noqa: UP006
                hidden_effects=argument('hidden_effects', List[str]),  # noqa: UP006
            ),
            node(
                'identifier',
                estimator=argument('estimator', str),
                effect_files=argument('effect_files', List[str]),  # noqa: UP006
                refit_period=argument('refit_period', float),
                diagnose_period=argument('diagnose_period', float),
            ),
            node(
                'recorder',
                IfCondition(LaunchConfiguration('record')),
                path=argument('bag', str),
            ),
            node(
                'excitation',
                IfCondition(LaunchConfiguration('excite')),
                profile=argument('excitation', str),
            ),
            node('pid', profile=argument('profile', str)),
        ]
    )
