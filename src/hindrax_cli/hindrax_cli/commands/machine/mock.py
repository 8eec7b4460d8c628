"""`hindrax mock`: the mock vehicle's devices alone, at stable paths, for third-party programs and bench work."""

import argparse
import contextlib
import json
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

from hindrax_bag.metadata import try_lock
from hindrax_bringup.stack import MockOptions
from hindrax_bringup.stack_lock import runtime_folder
from hindrax_bringup.stack_runner import asked_to_end
from hindrax_cli.argument_types import add_json, add_vehicle, within
from hindrax_cli.command import command, option
from hindrax_cli.commands.operate.up_stop import add_mock_options, mock_options
from hindrax_core.errors import HindraxError, UsageError, cause
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.bus_capture import mount_of
from hindrax_drivers.buses.line import UDP_PREFIX
from hindrax_drivers.devices.a50 import A50
from hindrax_drivers.devices.dvl75 import Dvl75
from hindrax_sim.buses.serial_ends import AUTOPILOT_SERVED, OF_DEVICE, TcpEnd, UdpEnd
from hindrax_sim.conditions.world_table import sizes_of
from hindrax_sim.faults.fault_registry import parse_fault
from hindrax_sim.hardware import THRUSTERS, Hardware
from hindrax_sim.mock_vehicle import MockVehicle
from hindrax_sim.world import Conditions


@command(
    "./hindrax mock --print-paths\n# a bus that unmodified programs open:\nsudo ./hindrax mock --i2c-device /dev/i2c-9",
    option("--print-paths", action="store_true", help="only `NAME PATH` lines on stdout, for scripts"),
    add_json,
    add_vehicle,
    option("--folder", type=Path, metavar="DIR", help="folder of ports and socket; default: stable, per user"),
    option("--i2c-device", metavar="PATH", help="also serve the I2C bus as this file (root, /dev/fuse)"),
    option(
        "--dvl-udp",
        action="store_true",
        help="the DVL sends by UDP to port 27000 of this machine and listens at 50000",
    ),
    option("--dvl-tcp", action="store_true", help="the A50 of the vehicle serves TCP port 16171 of this machine"),
    option(
        "--autopilot-tcp",
        nargs="?",
        type=within(int, 1, 65535),
        const=AUTOPILOT_SERVED,
        metavar="PORT",
        help=f"its ArduSub serves a TCP port of this machine; default {AUTOPILOT_SERVED}, as the first simulator there",
    ),
    add_mock_options,
)
def mock(arguments: argparse.Namespace) -> int:
    """The mock vehicle's devices alone (serial ports, I2C bus), until Ctrl-C."""
    words = document if arguments.json else plain if arguments.print_paths else table
    faces = {"place": arguments.folder, "i2c_device": arguments.i2c_device, "dvl_udp": arguments.dvl_udp}
    faces |= {"dvl_tcp": arguments.dvl_tcp, "autopilot_tcp": arguments.autopilot_tcp}
    with asked_to_end() as over:
        serve(Path(arguments.vehicle), mock_options(arguments), lambda ports: print_fitted(words(ports)), over, **faces)
    return 0


def serve(
    vehicle_file: Path,
    options: MockOptions,
    announce: Callable[[Mapping[str, str]], None],
    over: Callable[[], bool],
    *,
    place: Path | None = None,
    i2c_device: str | None = None,
    dvl_udp: bool = False,
    dvl_tcp: bool = False,
    autopilot_tcp: int | None = None,
) -> None:
    """Serve the devices of a mock vehicle until it is over.

    Parameters
    ----------
    vehicle_file
        Which devices, and the truth.
    options
        Seed, pace, faults and world.
    announce
        Gets every port by name once all are up.
    over
        Looked at between steps.
    place
        Folder of the ports; None: one of this user's.
    i2c_device
        A file to mount as the bus too; None: none.
    dvl_udp, dvl_tcp
        Whether the DVL-75, or the A50 is on the network.
    autopilot_tcp
        TCP port at which the ArduSub is on the network; None: it is not.

    Raises
    ------
    UsageError
        For an autopilot where the output of the vehicle is another.
    """
    vehicle = load_vehicle(vehicle_file)
    if autopilot_tcp is not None and vehicle.output.device != "ardusub":
        raise UsageError(f"--autopilot-tcp: the output of {vehicle.name} is a {vehicle.output.device}, wanted ardusub")
    faults = [parse_fault(fault, vehicle) for fault in options.faults]
    conditions = Conditions(sizes=sizes_of(options.world, options.seed))
    with (
        _own(place or runtime_folder() / "mock") as folder,
        MockVehicle(Hardware(vehicle, options.seed, conditions, faults), folder, rate=options.rate) as mock,
        _offered(mock, i2c_device),
    ):
        if dvl_udp:
            mock.put_on_network(mount_of(vehicle, Dvl75)[0], UdpEnd())
        if dvl_tcp:
            mock.put_on_network(mount_of(vehicle, A50)[0], TcpEnd())
        if autopilot_tcp is not None:
            mock.put_on_network(THRUSTERS, TcpEnd(autopilot_tcp))
        announce(mock.ports | {"clock": mock.clock} | ({"i2c-device": i2c_device} if i2c_device is not None else {}))
        while not over():
            mock.step()


@contextlib.contextmanager
def _offered(mock: MockVehicle, path: str | None) -> Iterator[None]:
    """Offer the I2C bus as a file too, where a path is given; HindraxError without the extra that does."""
    if path is None:
        yield
        return
    try:
        from hindrax_i2c_file.fuse_i2c import FuseI2c  # noqa: PLC0415  # an extra, for this option only
    except ModuleNotFoundError as error:
        raise HindraxError(
            f"--i2c-device {path}: found no package hindrax_i2c_file, wanted this extra; `./hindrax setup` builds it"
        ) from error
    with contextlib.closing(mock.offer_file(partial(FuseI2c, path))):
        yield


@contextlib.contextmanager
def _own(folder: Path) -> Iterator[Path]:
    """Make the folder and hold it: two mocks in one would take each other's ports away."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "lock").open("w")
    except OSError as error:
        raise UsageError(f"{folder}: cannot be made ({cause(error)}); choose another with --folder") from error
    with lock:
        if not try_lock(lock):
            raise HindraxError(f"{folder}: a mock runs there already; end it, or choose another --folder")
        yield folder


def table(found: Mapping[str, str]) -> str:
    """Return the ports as text."""
    width = max(len(name) for name in found)
    lines = [f"  {name:{width}}  {path}" for name, path in found.items()]
    note = "mock:SOCKET is for hindrax (--port); the other paths open as they are"
    for address in (path for path in found.values() if path.startswith(UDP_PREFIX)):
        note += f"; {address}: listen there; it accepts commands at port {OF_DEVICE}"
    return "\n".join(["the mock vehicle's devices are up:", *lines, f"  ({note})", "  Ctrl-C ends them"])


def plain(found: Mapping[str, str]) -> str:
    """Return the ports for a script, one `NAME PATH` a line."""
    return "\n".join(f"{name} {path}" for name, path in found.items())


def document(found: Mapping[str, str]) -> str:
    """Return the ports as one JSON document."""
    return json.dumps({"ports": dict(found)})
