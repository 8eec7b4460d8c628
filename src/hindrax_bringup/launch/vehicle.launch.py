"""The onboard stack on a ROS installation: `ros2 launch hindrax_bringup vehicle.launch.py vehicle:=F record:=DIR`.

The graph keeps to this machine, or reaches over the tether that HINDRAX_TETHER names, as with `./hindrax up`.
"""

from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, NotEqualsSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from hindrax_bringup import security
from hindrax_bringup.launched import settings
from hindrax_bringup.system import ONBOARD, RECORDER, Process
from hindrax_bringup.vehicles import default_vehicle
from launch import LaunchDescription


def node(process: Process, **keywords: object) -> Node:
    """One process of the description, started again when it dies; its nodes name themselves."""
    words = {"vehicle": LaunchConfiguration("vehicle"), "bag": LaunchConfiguration("record")}
    # Whatever their names look like: launch would take 2026 for a number, and nothing for no value at all.
    parameters = {name: ParameterValue(word, value_type=str) for name, word in words.items()}
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
    return LaunchDescription(
        [
            DeclareLaunchArgument("vehicle", default_value=str(default_vehicle()), description="vehicle file"),
            DeclareLaunchArgument("record", default_value="", description="new folder for the bag; empty: no bag"),
            *(SetEnvironmentVariable(key, value) for key, value in settings(mock=False)),
            *(node(process) for process in ONBOARD),
            node(RECORDER, condition=IfCondition(NotEqualsSubstitution(LaunchConfiguration("record"), ""))),
        ]
    )
