"""The onboard stack on real hardware: `ros2 launch hindrax_bringup vehicle.launch.py vehicle:=F record:=DIR`.

The graph keeps to this machine, or reaches over the tether that HINDRAX_TETHER names, as with `./hindrax up`.
"""

from hindrax_bringup.launch_actions import stack
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Every onboard process, and the recorder where a folder is named."""
    return stack({})
