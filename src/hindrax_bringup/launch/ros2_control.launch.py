"""Allocator, output and identifier for a vehicle of ros2_control: `ros2 launch hindrax_bringup ros2_control.launch.py`.

The defaults are the BlueROV2 of auv_controllers: its velocity controller, or whoever else, publishes wrenches as for
its thruster_allocation_matrix_controller, and its eight thruster controllers take the forces.
"""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from hindrax_bringup.share_files import share_folder
from hindrax_core.topics import NAMESPACE
from launch import LaunchDescription

ARGUMENTS = {
    "vehicle": (
        str(share_folder("config") / "bluerov2-ros2-control.yaml"),
        "vehicle file with output.device ros2_control",
    ),
    "namespace": (NAMESPACE, "of our nodes and topics"),
    "reference": ("/thruster_allocation_matrix_controller/reference", "topic of the wrenches (geometry_msgs/Wrench)"),
    "reference_frame": (
        "base_link_fsd",
        "their frame: base_link_fsd (z down, as auv_controllers), or base_link (z up)",
    ),
    "odometry": ("/odometry", "odometry of base_link, world with z up (nav_msgs/Odometry)"),
}


def generate_launch_description() -> LaunchDescription:
    """Describe three processes; each is started again when it ends."""
    given = {name: LaunchConfiguration(name) for name in ARGUMENTS}
    wrenches = {name: given[name] for name in ("reference", "reference_frame")}
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=one, description=why)
                for name, (one, why) in ARGUMENTS.items()
            ),
            _node("hindrax_drivers", "thrusters", given),
            _node("hindrax_control", "allocator", given, wrenches),
            _node("hindrax_ident", "identifier", given, {}, [("odometry", given["odometry"])]),
        ]
    )


def _node(
    package: str,
    executable: str,
    given: dict[str, LaunchConfiguration],
    parameters: dict[str, LaunchConfiguration] | None = None,
    remappings: list[tuple[str, LaunchConfiguration]] | None = None,
) -> Node:
    return Node(
        package=package,
        executable=executable,
        namespace=given["namespace"],
        parameters=[{"vehicle": given["vehicle"], **(parameters or {})}],
        remappings=remappings or [],
        respawn=True,
        respawn_delay=1.0,
        output="screen",
    )
