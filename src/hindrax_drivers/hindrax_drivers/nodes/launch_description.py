"""Launch descriptions of single devices; imported by the files in `launch/` alone, for launch is not among the wheels.

Every setting is an argument: `ros2 launch hindrax_drivers dvl75.launch.py --show-args` lists the driver's knobs.
"""

from collections.abc import Callable
from dataclasses import fields
from functools import partial
from typing import Any

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from hindrax_core.knobs import knob_of
from hindrax_core.vehicle import ADDRESS_MEANING, Output
from hindrax_drivers.driver_registry import PORTS, driver_of
from hindrax_drivers.nodes.thruster_settings import OutputAlone
from hindrax_drivers.output.output_guard import OutputGuardKnobs
from launch import LaunchContext, LaunchDescription

Argument = tuple[object, str]
"""Default and meaning."""
ANY: dict[str, tuple[str | None, str]] = {
    "device": (None, "kind of sensor, of the table or of an installed package"),
    "port": ("", "port; empty: by its parameters, or the usual one"),
    "namespace": ("/", "namespace of its topics and services"),
    "parameters": ("", "ROS parameter file with its settings"),
}


def device(kind: str) -> Callable[[], LaunchDescription]:
    """Return what describes one sensor of the table."""
    row = driver_of(kind)
    arguments: dict[str, Argument] = {
        "port": (PORTS[row.wire], "port"),
        "frame_id": (f"{kind}_link", "frame of its messages"),
    }
    if not row.serial:
        arguments["address"] = (None, ADDRESS_MEANING)
    return partial(_described, "device", [kind], arguments | _knobs(row.knobs()))


def any_device() -> LaunchDescription:
    """One sensor whose kind is an argument; its settings are in a ROS parameter file, for only a kind has its own."""

    def start(context: LaunchContext) -> list[Node]:
        given = {name: str(context.launch_configurations[name]) for name in ANY}
        driver_of(given["device"])  # a UsageError names those that there are
        settings: list[object] = [given["parameters"]] if given["parameters"] else []
        if given["port"]:
            settings.append({"port": given["port"]})
        return [_node("device", [given["device"]], given["namespace"], settings)]

    declared = [DeclareLaunchArgument(name, default_value=one, description=why) for name, (one, why) in ANY.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])


def thrusters() -> LaunchDescription:
    """A PCA9685 behind the output guard and its dead man."""
    alone = OutputAlone()
    arguments: dict[str, Argument] = {
        "port": (alone.output.port, "port"),
        "channels": (list(alone.channels), "output channels of the thrusters, in the order of the commands"),
    }
    chip = {f"output.{name}": one for name, one in _knobs(Output()).items() if name not in ("device", "port")}
    return _described("thrusters", [], arguments | chip | _knobs(OutputGuardKnobs()))


def _knobs(defaults: Any) -> dict[str, Argument]:
    return {one.name: (getattr(defaults, one.name), knob_of(one).meaning) for one in fields(defaults)}


def _described(executable: str, words: list[str], arguments: dict[str, Argument]) -> LaunchDescription:
    """A process of this package with its arguments as parameters; respawned, as its port may come later."""
    parameters, declared = {}, {"namespace": ("/", "namespace of its topics and services")} | arguments
    for name, (default, _) in arguments.items():
        parameters[name] = ParameterValue(LaunchConfiguration(name), value_type=_kind(default))
    node = _node(executable, words, LaunchConfiguration("namespace"), [parameters])
    actions = [
        DeclareLaunchArgument(name, default_value=_text(one), description=why) for name, (one, why) in declared.items()
    ]
    return LaunchDescription([*actions, node])


def _node(executable: str, words: list[str], namespace: object, parameters: list[object]) -> Node:
    return Node(
        package="hindrax_drivers",
        executable=executable,
        arguments=words,
        namespace=namespace,
        parameters=parameters,
        respawn=True,
        respawn_delay=1.0,
        output="screen",
    )


def _kind(default: object) -> object:
    if default is None:
        return None  # whatever YAML makes of it; the node takes an empty text as not set
    return list[type(default[0])] if isinstance(default, list | tuple) else type(default)  # type: ignore[misc]  # at run time


def _text(default: object) -> str:
    """As YAML, which launch reads it as; it refuses a null, so what is not set is an empty text in quotes."""
    if default is None:
        return "''"
    if isinstance(default, bool):
        return str(default).lower()
    return str(list(default)) if isinstance(default, list | tuple) else str(default)
