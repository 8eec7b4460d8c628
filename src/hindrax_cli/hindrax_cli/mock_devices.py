"""The mock vehicle's devices alone: ports at stable paths, for third-party programs and bench work, without ROS."""

from __future__ import annotations

import contextlib
import fcntl
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from hindrax_bringup.stack import MockOptions
from hindrax_bringup.stack_lock import runtime_folder
from hindrax_core.errors import HindraxError, UsageError, cause
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.bus_capture import mount_of
from hindrax_drivers.buses.line import UDP_PREFIX
from hindrax_sim.buses.serial_ends import OF_DEVICE, TO_HOST, UdpLine
from hindrax_sim.conditions.world_table import sizes_of
from hindrax_sim.faults.fault_registry import parse_fault
from hindrax_sim.mock_vehicle import MockVehicle
from hindrax_sim.world import Conditions

UDP_PORT = f"{UDP_PREFIX}0.0.0.0:{TO_HOST}"
"""Port of a DVL that speaks by UDP, as a vehicle file has it."""


@dataclass(frozen=True, slots=True)
class DeviceOptions:
    """Vehicle, behavior, folder of the ports (None: the default), and further interfaces.

    A file to mount as a bus, and whether the DVL speaks on the network.
    """

    vehicle_file: Path
    mock: MockOptions
    folder: Path | None = None
    i2c_device: str | None = None
    dvl_udp: bool = False


def serve(options: DeviceOptions, tell: Callable[[Mapping[str, str]], None], over: Callable[[], bool]) -> None:
    """Serve until `over`; `tell` is called with every port by name once all are up."""
    vehicle = load_vehicle(options.vehicle_file)
    mocked = options.mock
    faults = [parse_fault(fault) for fault in mocked.faults]
    dvl = mount_of(vehicle, "dvl75")[0] if options.dvl_udp else ""
    conditions = Conditions(sizes=sizes_of(mocked.world, mocked.seed))
    with (
        _own(options.folder or runtime_folder() / "mock") as folder,
        MockVehicle(vehicle, folder, seed=mocked.seed, rate=mocked.rate, conditions=conditions, faults=faults) as mock,
        mock.offer_file(options.i2c_device) if options.i2c_device else contextlib.nullcontext(),
        UdpLine(mock.ports[dvl]) if options.dvl_udp else contextlib.nullcontext() as network,
    ):
        tell(paths(mock, options.i2c_device) | ({dvl: UDP_PORT} if options.dvl_udp else {}))
        while not over():
            mock.step()
            if network is not None:
                network.turn()


def paths(mock: MockVehicle, i2c_device: str | None) -> dict[str, str]:
    """Every port by the name of its device, then the clock, then the mounted bus."""
    found = mock.ports | {"clock": mock.clock}
    return found | ({"i2c-device": i2c_device} if i2c_device else {})


@contextlib.contextmanager
def _own(folder: Path) -> Iterator[Path]:
    """Make the folder and hold it: two mocks in one would take each other's ports away."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "lock").open("w")
    except OSError as error:
        raise UsageError(f"{folder}: cannot be made ({cause(error)}); choose another with --folder") from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise HindraxError(f"{folder}: a mock runs there already; end it, or choose another --folder") from error
        yield folder


def table(found: Mapping[str, str]) -> str:
    """Return the ports for a person."""
    width = max(len(name) for name in found)
    lines = [f"  {name:{width}}  {path}" for name, path in found.items()]
    note = "mock:SOCKET is for hindrax (--port); the other paths open as they are"
    if UDP_PORT in found.values():
        note += f"; {UDP_PORT} is to be listened at, and takes commands at port {OF_DEVICE}"
    return "\n".join(["the mock vehicle's devices are up:", *lines, f"  ({note})", "  Ctrl-C ends them"])


def plain(found: Mapping[str, str]) -> str:
    """Return the ports for a script, one `NAME PATH` a line."""
    return "\n".join(f"{name} {path}" for name, path in found.items())


def document(found: Mapping[str, str]) -> str:
    """Return the ports as one JSON document."""
    return json.dumps({"ports": dict(found)})
