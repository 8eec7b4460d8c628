"""A recorded run on the real nodes: ros2 launch hindrax_bringup replay.launch.py bag:=runs/today/bag.

Its wire frames come to the ports of the devices again, in their own time. To compare the outcome with the record, use
`./hindrax replay --ros`; this one is for looking, with whatever tool of ROS.
"""

import tempfile
from pathlib import Path

from launch.actions import DeclareLaunchArgument, ExecuteProcess, SetEnvironmentVariable, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage

from hindrax_bringup.launch_settings import parameter_file, settings
from hindrax_bringup.processes import CONTROL, IDENTIFIER, REPLAY, SENSORS, UNHEARD, Process
from hindrax_bringup.share_files import default_vehicle
from launch import LaunchDescription


def node(process: Process, file: str) -> Node:
    """One process on the recorded wires, started again until they are there.

    The maneuver that is heard of is the recorded one: nobody flies.
    """
    words = UNHEARD if process is CONTROL else []
    return Node(
        package=process.package,
        executable=process.executable,
        parameters=[file],
        ros_arguments=words,
        respawn=True,
        respawn_delay=1.0,
        output="screen",
    )


def generate_launch_description() -> LaunchDescription:
    """The record first; everything ends with it."""
    folder, vehicle = Path(tempfile.mkdtemp(prefix="hindrax-")), default_vehicle()
    file = str(parameter_file(folder, vehicle))
    replay = [ExecutableInPackage(package=REPLAY.package, executable=REPLAY.executable)]
    replay += ["--bag", LaunchConfiguration("bag"), "--vehicle", str(vehicle), "--folder", str(folder)]
    replay += ["--rate", LaunchConfiguration("rate")]
    return LaunchDescription(
        [
            DeclareLaunchArgument("bag", description="folder of a bag, or one of its files"),
            DeclareLaunchArgument("rate", default_value="1", description="times real time; 0: as fast as it goes"),
            *(SetEnvironmentVariable(key, value) for key, value in settings(mock=True)),
            ExecuteProcess(cmd=replay, output="screen", on_exit=Shutdown()),
            *(node(process, file) for process in (SENSORS, CONTROL, IDENTIFIER)),
        ]
    )
