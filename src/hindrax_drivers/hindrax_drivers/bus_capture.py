"""Capture the readings of one I2C device for a while, without ROS: for calibration, with the stack down."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

from hindrax_core.bus_operations import DeviceError, Program
from hindrax_core.bus_operations import run as run_program
from hindrax_core.driver_interface import Identity, Output, RegisterDevice, Trouble
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import Rejected, Stamp, Stamped, after
from hindrax_core.readings import Reading
from hindrax_core.vehicle import Mount, Vehicle
from hindrax_drivers.buses.bus_schedule import BusSchedule
from hindrax_drivers.buses.clock import pause
from hindrax_drivers.buses.ports import open_bus

ResultT = TypeVar("ResultT")
ANSWER_S = 3.0
"""Time in which a device says who it is, or is not there."""


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


def capture(
    port: str,
    device: RegisterDevice,
    seconds: float,
    progress: Callable[[float], None],
    answered: Callable[[], None] = lambda: None,
) -> CapturedReadings:
    """Run a device for some seconds of bus time from its answer on. HindraxError, with the last trouble, without one.

    `answered` is called in between: what a person has to do is told once there is a device that sees it.
    """
    heard = _Heard()
    with closing(_open(port)) as bus:
        schedule = BusSchedule()
        begin = bus.now()
        schedule.add("sensor", device, begin)

        def run(end: Stamp, over: Callable[[], object]) -> None:
            while (now := bus.now()) < end and not over():
                heard.take(output for _, outputs in schedule.run_next(now, bus.transfer) for output in outputs)
                bus.sleep_until(min(schedule.next_due(bus.now()), end))

        run(after(begin, ANSWER_S), lambda: heard.identity)
        if not heard.identity:
            raise HindraxError(f"{port}: {heard.trouble}")
        answered()
        begin = bus.now()
        end = after(begin, seconds)
        run(end, lambda: progress((bus.now() - begin) / (end - begin)))
    return CapturedReadings(heard.identity, tuple(heard.readings), tuple(heard.rejected))


@dataclass(slots=True)
class _Heard:
    """What a device has said until now."""

    identity: str = ""
    trouble: str = "no answer"
    readings: list[Stamped[Reading]] = field(default_factory=list)
    rejected: dict[str, None] = field(default_factory=dict)

    def take(self, outputs: Iterable[Output]) -> None:
        """Keep outputs of the device."""
        for output in outputs:
            if isinstance(output, Identity):
                self.identity = output.text
            elif isinstance(output, Trouble):
                self.trouble = output.text
            elif isinstance(output, Stamped):
                self.readings.append(output)
            elif isinstance(output, Rejected):
                self.rejected[output.reason] = None


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
