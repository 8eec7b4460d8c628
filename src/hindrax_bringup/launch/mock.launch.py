"""The stack on the mock vehicle: ros2 launch hindrax_bringup mock.launch.py seed:=7 rate:=1.

The mock lies at a fixed folder, so that its ports are known before it is up; nodes look for them until they are there.
"""

import tempfile
from pathlib import Path

from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage

from hindrax_bringup.launch_settings import announce, parameter_file, settings
from hindrax_bringup.processes import MOCK, ONBOARD
from hindrax_bringup.share_files import default_vehicle
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """The mock first, then every onboard process on its ports and its clock."""
    folder, vehicle = Path(tempfile.mkdtemp(prefix="hindrax-")), default_vehicle()
    file, made = str(parameter_file(folder, vehicle)), settings(mock=True)
    # Not a Node: that adds words of ROS, and the mock has its own.
    mock = [ExecutableInPackage(package=MOCK.package, executable=MOCK.executable)]
    mock += ["--vehicle", str(vehicle), "--folder", str(folder)]
    mock += ["--seed", LaunchConfiguration("seed"), "--rate", LaunchConfiguration("rate")]
    mock += ["--world", LaunchConfiguration("world")]
    stack = [
        Node(
            package=one.package,
            executable=one.executable,
            parameters=[file],
            respawn=one.restart,
            respawn_delay=1.0,
            output="screen",
        )
        for one in ONBOARD
    ]
    return LaunchDescription(
        [
            DeclareLaunchArgument("seed", default_value="1", description="of the mock's noise"),
            DeclareLaunchArgument("rate", default_value="1", description="times real time at most"),
            DeclareLaunchArgument("world", default_value="ideal", description="what the model does not know"),
            *(SetEnvironmentVariable(key, value) for key, value in made),
            ExecuteProcess(cmd=mock, output="screen"),
            OpaqueFunction(function=announce, kwargs={"mock": True, "made": made, "vehicle": str(vehicle)}),
            *stack,
        ]
    )
