"""Shared by the launch files: arguments, and the actions that start a stack as `hindrax up` starts it.

Everything happens when the launch is executed: `ros2 launch --show-args` makes no file and waits for nothing.
"""

import atexit
import contextlib
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    OpaqueFunction,
    RegisterEventHandler,
    SetEnvironmentVariable,
    Shutdown,
    UnsetEnvironmentVariable,
)
from launch.event_handlers import OnProcessIO
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage

from hindrax_bag.run_folder import write_parameters
from hindrax_bringup.network.tether import tether_setting
from hindrax_bringup.node_options import NodeOptions, ParameterOverrides
from hindrax_bringup.processes import ONBOARD, Process
from hindrax_bringup.ros_graph import graph_settings, set_aside
from hindrax_bringup.share_files import usual_vehicle, vehicle_file
from hindrax_bringup.stack import stack_environment
from hindrax_bringup.stack_lock import CLONE, LAUNCHED, StackLock, announced, runtime_folder
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_stderr
from hindrax_core.topics import NAMESPACE
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.driver_registry import driver_of
from launch import Action, LaunchContext, LaunchDescription

ARGUMENTS: dict[str, tuple[str | None, str]] = {
    "vehicle": (usual_vehicle(), "file or name"),
    "namespace": (NAMESPACE, "of all nodes and topics"),
    "params_file": ("", "ROS parameter file for the nodes"),
    "record": ("", "folder for the bag; empty: no bag"),
    "without_operator": ("stay", "without heartbeats of an operator: hold, neutral, or stay (none is expected)"),
}
"""Arguments of every stack: default and meaning."""


def stack(
    more: Mapping[str, tuple[str | None, str]],
    hardware: Process | None = None,
    words: Mapping[str, str] | None = None,
    onboard: Sequence[Process] = ONBOARD,
    remaps: Mapping[str, Sequence[str]] | None = None,
) -> LaunchDescription:
    """Describe a stack with arguments beside `ARGUMENTS`, on real hardware or on the process that replaces it.

    `words`: option of the hardware process behind each argument. `remaps`: further ROS arguments by process.
    """

    def start(context: LaunchContext) -> list[Action]:
        def argument(name: str) -> str:
            return str(context.launch_configurations[name])

        vehicle = str(vehicle_file(argument("vehicle")))
        tuning = ParameterOverrides(
            argument("namespace"), argument("params_file"), sensors=tuple(load_vehicle(vehicle).sensors)
        )
        wires: dict[str, Any] | None = None
        tether = None if hardware else tether_setting()
        made = stack_environment(mock=hardware is not None, domain=None, tether=tether)
        started: list[Action] = [
            SetEnvironmentVariable(key, value) for key, value in made.items() if os.environ.get(key) != value
        ]
        started += [UnsetEnvironmentVariable(name) for name in set_aside(os.environ, made)]
        mock: Action | None = None
        if hardware is not None:
            folder = runtime_folder() / f"{os.getpid()}.{hardware.name}"
            wires = ports(folder, vehicle)
            line = ["--vehicle", vehicle, "--folder", str(folder), "--namespace", tuning.namespace]
            # An option is repeated for each word of its value.
            given = [(option, one) for name, option in (words or {}).items() for one in argument(name).split()]
            line += [word for pair in given for word in pair]
            # Not a Node: that adds words of ROS, and this process has its own.
            program = ExecutableInPackage(package=hardware.package, executable=hardware.name)
            ends = Shutdown(reason=f"the {hardware.name} has ended")
            mock = ExecuteProcess(cmd=[program, *line], output="screen", on_exit=ends)
        record = argument("record")
        options = NodeOptions(
            vehicle,
            tuning,
            bag=str(Path(record).resolve()) if record else "",
            notes="ros2 launch",
            without_operator=argument("without_operator"),
            wires=wires,
            more=remaps or {},
        )
        for sentence in options.unknown_blocks():
            print_stderr(sentence)
        file = runtime_folder() / f"{os.getpid()}.parameters.yaml"
        write_parameters(file, options.parameters())
        atexit.register(file.unlink, missing_ok=True)
        _announce(options, made)
        chosen = [one for one in options.processes if one in onboard or one not in ONBOARD]
        nodes = [_node(one, file, options) for one in chosen]
        if mock is None:
            return [*started, *nodes]
        # Its first line reports that its devices exist; before, each node would warn of missing devices.
        to_start = iter([nodes])
        at_first_word = OnProcessIO(target_action=mock, on_stdout=lambda _: next(to_start, None))
        return [*started, RegisterEventHandler(at_first_word), mock]

    declared = [
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (default, meaning) in (ARGUMENTS | dict(more)).items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=_beside_the_tether, args=[start, hardware is None])])


def _beside_the_tether(context: LaunchContext, start: Callable[[LaunchContext], list[Action]], real: bool) -> object:
    """Start at once, or when the tether that this terminal names is up: earlier, discovery finds no participant."""
    if not real or tether_setting() is None:
        return start(context)

    def proceed(event: object, context: LaunchContext) -> object:
        ready = getattr(event, "returncode", 1) == 0
        return start(context) if ready else Shutdown(reason="the tether was not waited for")

    words = [sys.executable, "-m", "hindrax_bringup.network.tether"]
    return [ExecuteProcess(cmd=words, output="screen", on_exit=proceed)]


def _node(process: Process, file: Path, options: NodeOptions) -> Node:
    """One process: started again a second after it has died, unless its arguments were refused."""

    def on_exit(event: object, _context: LaunchContext) -> object:
        if getattr(event, "returncode", 0) == UsageError.exit_code:
            return Shutdown(reason=f"{process.name}: refused its arguments")
        return None

    return Node(
        package=process.package,
        executable=process.name,
        parameters=[str(file)],
        ros_arguments=options.arguments(process),
        respawn=process.restart,
        respawn_delay=1.0,
        on_exit=on_exit,
        output="screen",
    )


def _announce(options: NodeOptions, made: Mapping[str, str]) -> None:
    """Let `hindrax monitor`, `arm` and the like find this stack, until this process ends."""
    lock = StackLock(
        os.getpid(),
        options.wires is not None,
        options.vehicle,
        options.bag,
        graph_settings(made),
        options.wires["ports"] if options.wires is not None else {},
        purpose=LAUNCHED,
        namespace=options.tuning.namespace,
        bag=options.bag,
        clone=os.environ.get(CLONE, ""),
    )
    until_the_end = contextlib.ExitStack()
    atexit.register(until_the_end.close)
    until_the_end.enter_context(announced(lock))


def ports(folder: Path, vehicle_file: str) -> dict[str, Any]:
    """Ports of simulated hardware in a folder: serial devices as ptys, everything else on its bus."""
    bus = f"mock:{folder / 'i2c'}"
    sensors = load_vehicle(vehicle_file).sensors
    found = {name: str(folder / name) if driver_of(one.device).serial else bus for name, one in sensors.items()}
    return {"ports": found | {"thrusters": bus}, "clock": bus}
