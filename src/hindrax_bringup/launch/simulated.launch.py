"""The stack on a vehicle of another simulator: `ros2 launch hindrax_bringup simulated.launch.py simulator:=gz`.

Start the simulator first: its odometry brings the time. With `record:=DIR` the run is recorded.
"""

from hindrax_bringup.launch_actions import stack
from hindrax_bringup.stack import MockOptions
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Emulated devices that show the simulated state, then every onboard process on them."""
    arguments = {
        "simulator": (None, "mujoco, gz, stonefish, or one with its prefix, such as gz:/model/rov"),
        "seed": ("1", "of the noise of the emulated devices"),
        "rate": ("0", "times real time at most; 0: the simulator decides"),
        "world": ("ideal", "effects outside the model; the simulator has its own water"),
        "faults": ("", "faults of devices, as for `./hindrax up --fault`; several separated by blanks"),
    }
    return stack(arguments, MockOptions)
