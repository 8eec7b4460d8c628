"""Capture the readings of one I2C device for a while, without ROS: for calibration, with the stack down."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from hindrax_core.bus_operations import DeviceError, Program
from hindrax_core.bus_operations import run as run_program
from hindrax_core.driver_interface import Identity, RegisterDevice, Trouble
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import Rejected, Stamped, after
from hindrax_core.readings import Reading
from hindrax_core.vehicle import Mount, Vehicle
from hindrax_drivers.buses.bus_schedule import BusSchedule
from hindrax_drivers.buses.clock import pause
from hindrax_drivers.buses.ports import open_bus

ResultT = TypeVar("ResultT")


@dataclass(frozen=True, slots=True)
class CapturedReadings:
    """Identity and readings of a device, in order, and each reason why something was rejected."""

    identity: str
    readings: tuple[Stamped[Reading], ...]
    rejected: tuple[str, ...] = ()

    def of(self, kind: type[Any]) -> list[Any]:
        """Readings of one kind, without their stamps."""
        return [one.reading for one in self.readings if isinstance(one.reading, kind)]


def mount_of(vehicle: Vehicle, device: str) -> tuple[str, Mount]:
    """Name and mount of the vehicle's sensor of a kind; UsageError when there is none."""
    for name, mount in vehicle.sensors.items():
        if mount.device == device:
            return name, mount
    raise UsageError(f"vehicle {vehicle.name}: found no sensor with device {device}; check sensors in the vehicle file")


def capture(port: str, device: RegisterDevice, seconds: float, progress: Callable[[float], None]) -> CapturedReadings:
    """Run a device for some seconds of bus time. HindraxError, with the last trouble, when it does not answer."""
    identity, trouble, readings = "", "no answer", []
    rejected: dict[str, None] = {}
    with closing(_open(port)) as bus:
        schedule = BusSchedule()
        begin = bus.now()
        schedule.add("sensor", device, begin)
        end = after(begin, seconds)
        while (now := bus.now()) < end:
            for _, outputs in schedule.run_next(now, bus.transfer):
                for output in outputs:
                    if isinstance(output, Identity):
                        identity = output.text
                    elif isinstance(output, Trouble):
                        trouble = output.text
                    elif isinstance(output, Stamped):
                        readings.append(output)
                    elif isinstance(output, Rejected):
                        rejected[output.reason] = None
            progress((now - begin) / (end - begin))
            bus.sleep_until(min(schedule.next_due(bus.now()), end))
    if not identity:
        raise HindraxError(f"{port}: {trouble}")
    return CapturedReadings(identity, tuple(readings), tuple(rejected))


def run_once(port: str, program: Program[ResultT]) -> ResultT:
    """Run one program to its end."""
    with closing(_open(port)) as bus:
        try:
            return run_program(program, bus.transfer, partial(pause, bus))
        except DeviceError as error:
            raise HindraxError(str(error)) from error


def _open(port: str) -> Any:
    try:
        return open_bus(port, "tool")
    except DeviceError as error:
        raise HindraxError(str(error)) from error
