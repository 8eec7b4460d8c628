"""Shared by the launch files: arguments, and the one process that they start, that of `hindrax up` (`stack_runner`).

Everything happens when the launch is executed: `ros2 launch --show-args` makes no file and waits for nothing.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction, Shutdown

from hindrax_bringup.child_process import command_line
from hindrax_bringup.network.tether import tether_setting
from hindrax_bringup.node_options import ParameterOverrides
from hindrax_bringup.share_files import usual_vehicle, vehicle_file
from hindrax_bringup.stack import MockOptions, ReplayOptions
from hindrax_bringup.stack_process import END_S, RUNNER, SETTINGS, UpOptions
from hindrax_core.topics import NAMESPACE
from hindrax_core.vehicle import load_vehicle
from launch import Action, LaunchContext, LaunchDescription

ARGUMENTS: dict[str, tuple[str | None, str]] = {
    "vehicle": (usual_vehicle(), "file or name"),
    "namespace": (NAMESPACE, "of all nodes and topics"),
    "frame_prefix": ("", "of all frames, such as rov1/"),
    "params_file": ("", "ROS parameter file for the nodes"),
    "record": ("", "new folder of a run, with bag and logs; empty: no bag, logs below runs/"),
    "without_operator": ("stay", "without heartbeats of an operator: hold, neutral, or stay (none is expected)"),
}
"""Arguments of every stack: default and meaning."""
OF_HARDWARE: dict[type[MockOptions | ReplayOptions], dict[str, Callable[[str], Any]]] = {
    MockOptions: {
        "seed": int,
        "rate": float,
        "world": str,
        "faults": lambda words: tuple(words.split()),
        "simulator": str,
    },
    ReplayOptions: {"bag": str, "rate": float},
}
"""How the arguments of what replaces the vehicle are read."""


def stack(
    more: Mapping[str, tuple[str | None, str]], hardware: type[MockOptions | ReplayOptions] | None = None
) -> LaunchDescription:
    """Describe a stack with arguments beside `ARGUMENTS`, on real hardware or on what replaces it."""

    def start(context: LaunchContext) -> list[Action]:
        given: dict[str, str] = context.launch_configurations
        replaced = hardware and hardware(**{name: read(given[name]) for name, read in OF_HARDWARE[hardware].items()})
        vehicle = vehicle_file(given["vehicle"])
        sensors = tuple(load_vehicle(vehicle).sensors)
        options = UpOptions(
            vehicle,
            mock=replaced if isinstance(replaced, MockOptions) else None,
            replay=replaced if isinstance(replaced, ReplayOptions) else None,
            record=bool(given["record"]),
            out=str(Path(given["record"]).resolve()) if given["record"] else None,
            tether=None if hardware else tether_setting(),
            without_operator=given["without_operator"],
            launched=True,
            tuning=ParameterOverrides(
                given["namespace"], given["params_file"], frame_prefix=given["frame_prefix"], sensors=sensors
            ),
        )
        ends = Shutdown(reason="the stack has ended")
        patience = {"sigterm_timeout": str(END_S), "sigkill_timeout": str(END_S)}
        words = command_line(RUNNER, [options.to_json()])  # it ends with the launch, whatever ends that
        return [ExecuteProcess(cmd=words, additional_env=SETTINGS, output="screen", on_exit=ends, **patience)]

    declared = [
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (default, meaning) in (ARGUMENTS | dict(more)).items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
