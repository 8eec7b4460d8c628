"""Shared by the processes that replace hardware: main function, place in the graph, and end."""

import argparse
import contextlib
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import rclpy
from rclpy.signals import SignalHandlerOptions

from hindrax_core.errors import HindraxError
from hindrax_core.topics import namespace_arguments
from hindrax_sim.mock_vehicle import Ports

OUTPUT = "thrusters"
"""How the names of the clients begin that write to the thruster output: its node, and the dead man."""
SHUTDOWN_S = 4.0
"""Wall time that they have for their last pulses: `ros2 launch` sends SIGTERM after five seconds."""


def main_of(parser: argparse.ArgumentParser, run: Callable[[argparse.Namespace, Path], int]) -> int:
    """Run a process in the folder that its arguments name, or in a temporary one; returns its exit code.

    A folder that was not there before is removed at the end.
    """
    words = parser.parse_args()
    ours = not words.folder or not Path(words.folder).exists()
    folder = Path(words.folder or tempfile.mkdtemp(prefix="hindrax-"))
    folder.mkdir(parents=True, exist_ok=True)
    try:
        return run(words, folder)
    except HindraxError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)  # noqa: T201  # the operator reads it in the log
        return error.exit_code
    finally:
        if ours:
            shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def graph(namespace: str) -> Iterator[None]:
    """Take part in the ROS graph, with a clock of one's own in the namespace."""
    words = ["--ros-args", *namespace_arguments(namespace, own_clock=True)]
    rclpy.init(args=words, signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield
    finally:
        rclpy.try_shutdown()


def outlast_output(ports: Ports, shutdown_s: float = SHUTDOWN_S) -> None:
    """Step on until the thruster output has no writer: a Ctrl-C reaches hardware and nodes at once."""
    end_s = time.monotonic() + shutdown_s
    while any(name.startswith(OUTPUT) for name in ports.serve_clients(0.0)) and time.monotonic() < end_s:
        ports.step()
