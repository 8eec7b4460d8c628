"""Interface of a driver file (DRIVER: knobs and constructor), and helpers of drivers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, TypeAlias

from hindrax_core.bus_operations import DeviceError, Program, Write, WriteRead
from hindrax_core.driver_interface import Trouble
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamp, seconds_between
from hindrax_core.hydrostatics import Water
from hindrax_core.readings import Reading
from hindrax_core.sensor_table import Wire
from hindrax_core.vehicle import Mount, Vehicle

Condition: TypeAlias = Literal["well", "silent", "foreign"]


@dataclass(frozen=True, slots=True)
class Driver:
    """`make(knobs, mount, vehicle)` gives a SerialDevice or a RegisterDevice, by the table of sensors."""

    knobs: type[Any]
    make: Callable[[Any, Mount, Vehicle], Any]
    wire: Wire = "i2c"
    """By the table."""
    looking: Mapping[str, object] = field(default_factory=dict)
    """Knobs with which it changes nothing in the device, for a look by `hindrax doctor`."""

    @property
    def serial(self) -> bool:
        """Whether it is on a serial line; all others are on a register bus."""
        return self.wire == "serial"


class AcousticKnobs(Protocol):
    """Knobs of a device that measures by sound."""

    @property
    def speed_of_sound_mps(self) -> float | None:
        """Speed of sound that the device is to use; None: that of the water [m/s]."""


def sound_mps(knobs: AcousticKnobs, water: Water) -> float:
    """Speed of sound for a device: the one that its knobs set, or that of the water [m/s]."""
    return water.speed_of_sound_mps if knobs.speed_of_sound_mps is None else knobs.speed_of_sound_mps


class RegisterPart:
    """A part at an address of a register bus, with registers numbered by one byte."""

    def __init__(self, address: int | None, usual: int) -> None:
        """At its `usual` address where none is named; UsageError for one that I2C reserves (UM10204, table 4)."""
        self.address = usual if address is None else address
        if not 0x08 <= self.address <= 0x77:
            raise UsageError(f"address: found {self.address:#04x}, wanted 0x08 to 0x77; without it: {usual:#04x}")

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


class SilenceMonitor:
    """Reports silence and undecodable data of a serial line, once per episode.

    `name` is the device for the operator, `wanted` the expected data. Silence is reported after
    `stall_s`, foreign data after twice that.
    """

    def __init__(self, name: str, wanted: str, stall_s: float) -> None:
        self._name, self._wanted, self._stall_s = name, wanted, stall_s
        self.restart(Stamp(0))

    def restart(self, stamp: Stamp) -> None:
        """Reset after the line was opened."""
        self.last_byte = self.last_valid = stamp
        self.condition: Condition = "well"

    def tick(self, stamp: Stamp) -> list[Trouble]:
        """Update the condition; a new silent or foreign condition is returned as a Trouble."""
        before, self.condition = self.condition, "well"
        if seconds_between(self.last_byte, stamp) > self._stall_s:
            self.condition = "silent"
        elif seconds_between(self.last_valid, stamp) > 2.0 * self._stall_s:
            self.condition = "foreign"
        if self.condition in ("well", before):
            return []
        found = "bytes arrive but none of them verify", "check line speed and device"
        if self.condition == "silent":
            found = f"no byte for {self._stall_s:g} s", "check power, cable and port"
        return [Trouble(stamp, f"{self._name}: {found[0]}, wanted {self._wanted}; {found[1]}")]


AWAITED_S = 5.0
"""From the first reading of a device to its first of another kind, at the most: streams are asked for one after the
other, and a barometer is looked at before it counts."""


class MeasurementMonitor:
    """Which measurement of a device with several does not come, by kinds of readings and what they are for."""

    def __init__(self, needed: Mapping[type[Reading], str], stale_s: float) -> None:
        self._needed, self._stale_s = needed, stale_s
        self._last: dict[type[object], Stamp] = {}
        self._first: Stamp | None = None

    def received(self, reading: object, stamp: Stamp) -> None:
        """Note a reading."""
        self._last[type(reading)] = stamp
        self._first = stamp if self._first is None else self._first

    def missing(self, now: Stamp, trouble: str) -> str:
        """What does not come, with the `trouble` that the device has reported last; empty where all come."""
        # At the start of a device no sensor is suspected of what is only late.
        awaited = self._first is None or seconds_between(self._first, now) <= AWAITED_S
        for kind, what in self._needed.items():
            last = self._last.get(kind)
            if last is None and awaited and not trouble:
                return f"no {what} yet"
            if last is None or seconds_between(last, now) > self._stale_s:
                since = "yet" if last is None else f"for {seconds_between(last, now):.1f} s"
                return f"no {what} {since}; {trouble or f'check its sensor of {what}'}"
        return ""
