"""`hindrax joystick`: manual control by the messages of any joystick or keyboard tool of ROS 2."""

import argparse
import signal
from collections.abc import Sequence

import yaml

from hindrax_bringup.share_files import usual_vehicle, vehicle_file
from hindrax_bringup.stack import adopted, environment, environment_beside
from hindrax_cli.argument_types import named_vehicle
from hindrax_cli.command import command, option
from hindrax_control.teleop import TeleopKnobs
from hindrax_core.errors import UsageError
from hindrax_core.knobs import build
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.topics import namespace_arguments
from hindrax_operator.connection import add_stack, ordered_stack


@command(
    "./hindrax joystick\n"
    "# then, in another terminal, a joystick or the keyboard:\n"
    "ros2 run joy joy_node --ros-args -r joy:=/hindrax/joy\n"
    "ros2 run teleop_twist_keyboard teleop_twist_keyboard --ros-args -r cmd_vel:=/hindrax/cmd_vel",
    add_stack,
    named_vehicle("vehicle: its file, or its name; default: the one of the stack"),
    option(
        "--set", action="append", default=[], metavar="NAME:=VALUE", help="parameter of the node, such as dead_man:=5"
    ),
)
def joystick(arguments: argparse.Namespace) -> int:
    """Steer manually: /hindrax/joy and /hindrax/cmd_vel become wrenches, until Ctrl-C."""
    check(arguments.set)
    found = ordered_stack(arguments)
    file = arguments.vehicle or (found.vehicle if found else str(vehicle_file(usual_vehicle())))
    mock = arguments.sim_time or (found is not None and found.mock)
    given = [f"vehicle:={file}", f"use_sim_time:={str(mock).lower()}", *arguments.set]
    remaps = namespace_arguments(found.namespace if found else arguments.namespace, own_clock=mock)
    words = ["teleop", "--ros-args", *remaps, *(word for one in given for word in ("-p", one))]
    with adopted(environment_beside(found) if found else environment(mock=False, domain=None)):
        from hindrax_control.nodes.teleop_node import TeleopNode  # noqa: PLC0415  # rclpy reads the environment first
        from hindrax_ros.process import StopSignal, spin  # noqa: PLC0415  # as above

        ready = "hold the dead-man button and steer" if found else "a vehicle that publishes there can be steered"
        print_fitted(f"{ready}; Ctrl-C ends it")
        stop = StopSignal()
        code = spin(lambda: [TeleopNode()], words, stop)
        if stop.number == signal.SIGINT:
            raise KeyboardInterrupt
        return code


def check(words: Sequence[str]) -> None:
    """UsageError for a parameter that the node does not have, or cannot have at this value."""
    given: dict[str, object] = {}
    for word in words:
        name, assigned, value = word.partition(":=")
        if not assigned:
            raise UsageError(f"--set {word}: wanted NAME:=VALUE, such as dead_man:=5")
        try:
            given[name] = yaml.safe_load(value)
        except yaml.YAMLError:
            given[name] = value
    build(TeleopKnobs, given, "--set")
