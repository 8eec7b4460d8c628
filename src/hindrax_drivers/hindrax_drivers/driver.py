"""What a driver file offers under the name DRIVER, its knobs and its constructor, and what register drivers share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from hindrax_core.bus_operations import DeviceError, Program, Write, WriteRead
from hindrax_core.vehicle import Mount, Vehicle


@dataclass(frozen=True, slots=True)
class Driver:
    """`make(knobs, mount, vehicle)` gives a SerialDevice or a RegisterDevice, as the table of sensors says."""

    knobs: type[Any]
    make: Callable[[Any, Mount, Vehicle], Any]


def in_water(knobs: Any, vehicle: Vehicle) -> Any:
    """Knobs with the speed of sound of the vehicle's water, unless they set another."""
    if knobs.speed_of_sound_mps != type(knobs)().speed_of_sound_mps:
        return knobs
    return replace(knobs, speed_of_sound_mps=vehicle.water.speed_of_sound_mps)


class RegisterPart:
    """A part at an address of a register bus, with registers numbered by one byte."""

    def __init__(self, address: int) -> None:
        self.address = address

    def get(self, register: int, count: int) -> WriteRead:
        """Operation that reads so many bytes, from a register on."""
        return WriteRead(self.address, bytes([register]), count)

    def set(self, register: int, *values: int) -> Write:
        """Operation that writes bytes, from a register on."""
        return Write(self.address, bytes([register, *values]))

    def word(self, register: int) -> Program[int]:
        """Read a word, high byte first."""
        return int.from_bytes((yield self.get(register, 2)), "big")

    def error(self, text: str) -> DeviceError:
        """Error that names the address."""
        return DeviceError(f"address {self.address:#04x}: {text}")
