"""`hindrax mock`: the mock vehicle's devices alone."""

from __future__ import annotations

import argparse
from pathlib import Path

from hindrax_bringup.stack_runner import asked_to_end
from hindrax_cli.argument_types import add_json, add_vehicle
from hindrax_cli.commands.operate.up import add_mock_options, mock_options
from hindrax_cli.mock_devices import DeviceOptions, document, plain, serve, table
from hindrax_core.text.screen_text import print_fitted

NAME = "mock"
HELP = "the mock vehicle's devices alone (serial ports, I2C bus), until Ctrl-C"
EXAMPLE = (
    "./hindrax mock --print-paths\n"
    "  sudo ./hindrax mock --i2c-device /dev/i2c-9     (a bus that unmodified programs open; needs root)"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Vehicle, behavior, and where the ports lie."""
    parser.add_argument("--print-paths", action="store_true", help="only `NAME PATH` lines on stdout, for scripts")
    add_json(parser)
    add_vehicle(parser)
    parser.add_argument(
        "--folder", type=Path, metavar="DIR", help="where ports and socket lie; default: stable, per user"
    )
    parser.add_argument("--i2c-device", metavar="PATH", help="also serve the I2C bus as this file (root, /dev/fuse)")
    parser.add_argument(
        "--dvl-udp",
        action="store_true",
        help="the DVL speaks by UDP to port 27000 of this machine and listens at 50000",
    )
    add_mock_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Serve until a signal, which is the normal end."""
    format_ports = document if arguments.json else plain if arguments.print_paths else table
    options = mock_options(arguments)
    faces = (arguments.i2c_device, arguments.dvl_udp)
    wanted = DeviceOptions(Path(arguments.vehicle), options, arguments.folder, *faces)
    with asked_to_end() as over:
        serve(wanted, lambda found: print_fitted(format_ports(found)), over)
    return 0
