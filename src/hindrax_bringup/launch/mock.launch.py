"""The stack on the mock vehicle, with which it ends: `ros2 launch hindrax_bringup mock.launch.py seed:=7 rate:=1`."""

from hindrax_bringup.launch_actions import stack
from hindrax_bringup.stack import MockOptions
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """The mock, then every onboard process on its ports and its clock."""
    arguments = {
        "seed": ("1", "of the mock's noise"),
        "rate": ("1", "times real time at most; 0: no bound"),
        "world": ("ideal", "effects outside the model, as for `./hindrax up --world`"),
        "simulator": ("", "another simulator that moves it, as for `./hindrax up --simulator`"),
        "faults": ("", "faults, as for `./hindrax up --fault`; several separated by blanks"),
    }
    return stack(arguments, MockOptions)
