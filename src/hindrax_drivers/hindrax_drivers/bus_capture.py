"""Capture the readings of one I2C device for a while, without ROS: for calibration, with the stack down."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from hindrax_core.bus_operations import Program
from hindrax_core.bus_operations import run as run_program
from hindrax_core.driver_interface import Identity, Output, RegisterDevice, Trouble
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import Rejected, Stamp, Stamped, after
from hindrax_core.readings import Reading
from hindrax_core.sensor_table import Capability, row_of
from hindrax_core.vehicle import Mount, Vehicle
from hindrax_drivers.buses.bus_schedule import BusSchedule
from hindrax_drivers.buses.clock import pause
from hindrax_drivers.buses.ports import open_bus

ResultT = TypeVar("ResultT")
ANSWER_S = 3.0
"""Time in which a device must identify itself."""


@dataclass(frozen=True, slots=True)
class CapturedReadings:
    """Identity and readings of a device, in order, and the last reason of each kind why something was rejected."""

    identity: str
    readings: tuple[Stamped[Reading], ...]
    rejected: tuple[str, ...] = ()

    def of(self, kind: type[ResultT]) -> list[ResultT]:
        """Readings of one kind, without their stamps."""
        return [one.reading for one in self.readings if isinstance(one.reading, kind)]


def mount_of(vehicle: Vehicle, driver: type[object], name: str | None = None) -> tuple[str, Mount]:
    """Find the sensor that a driver serves.

    Parameters
    ----------
    vehicle
        With its sensors.
    driver
        Class of the device.
    name
        Of the sensor, where there are several; None: the first.

    Returns
    -------
    tuple[str, Mount]
        Its name and mount. UsageError when there is none.
    """
    kind = driver.__module__.rpartition(".")[2]
    names = [one for one, mount in vehicle.sensors.items() if row_of(mount.device).driver_module == driver.__module__]
    return _chosen(vehicle, names, name, f"with device {kind}")


def measuring(vehicle: Vehicle, capability: Capability, name: str | None = None) -> tuple[str, Mount]:
    """Find the sensor that measures something.

    Parameters
    ----------
    vehicle
        With its sensors.
    capability
        What is measured.
    name
        Of the sensor, where there are several; None: the first.

    Returns
    -------
    tuple[str, Mount]
        Its name and mount. UsageError when there is none.
    """
    return _chosen(vehicle, vehicle.measuring(capability), name, f"that measures {capability}")


def _chosen(vehicle: Vehicle, names: Sequence[str], name: str | None, kind: str) -> tuple[str, Mount]:
    if not names:
        raise UsageError(f"vehicle {vehicle.name}: found no sensor {kind}; check sensors in the vehicle file")
    if name is not None and name not in names:
        raise UsageError(f"vehicle {vehicle.name}: found no sensor {kind} called {name!r}, wanted {' or '.join(names)}")
    found = names[0] if name is None else name
    return found, vehicle.sensors[found]


def capture(
    port: str,
    device: RegisterDevice,
    seconds: float,
    progress: Callable[[float], None],
    answered: Callable[[], None] = lambda: None,
) -> CapturedReadings:
    """Run a device for a while, from its answer on.

    Parameters
    ----------
    port
        Of its bus.
    device
        To be configured and cycled.
    seconds : [s]
        Bus time after its answer.
    progress
        Called with the time since.
    answered
        Called in between, to show the operator what to do once a device answers.

    Returns
    -------
    CapturedReadings
        What it measured.

    Raises
    ------
    HindraxError
        Without an answer, with the last trouble.
    """
    received: list[Output] = []
    with closing(open_bus(port, "tool")) as bus:
        schedule = BusSchedule()
        begin = bus.now()
        schedule.add("sensor", device, begin)

        def run(end: Stamp, over: Callable[[], object]) -> None:
            while (now := bus.now()) < end and not over():
                received.extend(output for _, outputs in schedule.run_next(now, bus.transfer) for output in outputs)
                bus.sleep_until(min(schedule.next_due(bus.now()), end))

        run(after(begin, ANSWER_S), lambda: any(isinstance(one, Identity) for one in received))
        identities = [one.text for one in received if isinstance(one, Identity)]
        if not identities:
            troubles = ["no answer", *(one.text for one in received if isinstance(one, Trouble))]
            raise HindraxError(f"{port}: {troubles[-1]}")
        answered()
        begin = bus.now()
        end = after(begin, seconds)
        run(end, lambda: progress((bus.now() - begin) / (end - begin)))
    rejected = {one.key: one.reason for one in received if isinstance(one, Rejected)}
    return CapturedReadings(
        identities[0], tuple(one for one in received if isinstance(one, Stamped)), tuple(rejected.values())
    )


def run_once(port: str, program: Program[ResultT]) -> ResultT:
    """Run one program to its end."""
    with closing(open_bus(port, "tool")) as bus:
        return run_program(program, bus.transfer, partial(pause, bus))
