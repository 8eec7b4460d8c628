"""The onboard stack on a ROS installation: `ros2 launch hindrax_bringup vehicle.launch.py vehicle:=F record:=DIR`.

The graph keeps to this machine, or reaches over the tether that HINDRAX_TETHER names, as with `./hindrax up`.
"""

from collections.abc import Mapping

from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, NotEqualsSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from hindrax_bringup import security
from hindrax_bringup.launch_settings import announce, settings
from hindrax_bringup.processes import ONBOARD, RECORDER, Process
from hindrax_bringup.share_files import default_vehicle
from launch import LaunchDescription


def node(process: Process, arguments: Mapping[str, str], **keywords: object) -> Node:
    """One process of the description, started again when it dies; its nodes name themselves.

    `arguments`: the launch argument behind each parameter.
    """
    # Text, whatever it looks like: launch would take 2026 for a number, and an empty one for no value at all.
    parameters = {name: ParameterValue(LaunchConfiguration(one), value_type=str) for name, one in arguments.items()}
    return Node(
        package=process.package,
        executable=process.executable,
        parameters=[parameters],
        ros_arguments=security.arguments(process.name),
        respawn=process.restart,
        respawn_delay=1.0,
        output="screen",
        **keywords,
    )


def generate_launch_description() -> LaunchDescription:
    """Every onboard process, and the recorder where a folder is named."""
    made = settings(mock=False)
    return LaunchDescription(
        [
            DeclareLaunchArgument("vehicle", default_value=str(default_vehicle()), description="vehicle file"),
            DeclareLaunchArgument("record", default_value="", description="new folder for the bag; empty: no bag"),
            *(SetEnvironmentVariable(key, value) for key, value in made),
            OpaqueFunction(function=announce, kwargs={"mock": False, "made": made}),
            *(node(process, {"vehicle": "vehicle"}) for process in ONBOARD),
            node(
                RECORDER,
                {"vehicle": "vehicle", "bag": "record"},
                condition=IfCondition(NotEqualsSubstitution(LaunchConfiguration("record"), "")),
            ),
        ]
    )
