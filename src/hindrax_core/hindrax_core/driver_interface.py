"""The two interfaces of a device driver. Both are pure; the owner of port, bus and clock calls them.

A serial device turns bytes and the passing of time into outputs. A register device offers bus programs. The same
objects run under a ROS node, in lock-step with the mock, and over the wire frames of a recorded bag.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from hindrax_core.bus_operations import Program
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.readings import Reading


@dataclass(frozen=True, slots=True)
class Send:
    """Bytes for the wire. With `wake`, the port first sends a BREAK of 1 ms, waits 1 ms and sends 'U' (auto-baud)."""

    data: bytes
    wake: bool = False


@dataclass(frozen=True, slots=True)
class Identity:
    """Identity of the device: model, serial number, firmware, as one line for the operator."""

    text: str


@dataclass(frozen=True, slots=True)
class Trouble:
    """Something the operator should read: a refused setting, a device reset, a missing acknowledgement."""

    stamp: Stamp
    text: str


Output: TypeAlias = Stamped[Reading] | Rejected | Send | Identity | Trouble


class SerialDevice(Protocol):
    """A device on a serial line."""

    @property
    def baud(self) -> int:
        """Line speed, always 8N1."""

    @property
    def ready(self) -> bool:
        """Whether the device has identified itself and accepted its settings."""

    def start(self, stamp: Stamp) -> Iterable[Output]:
        """Return what to send after the port was opened. Called again after a reconnection."""

    def feed(self, data: bytes, stamp: Stamp) -> Iterable[Output]:
        """Decode bytes that arrived at `stamp`."""

    def tick(self, stamp: Stamp) -> Iterable[Output]:
        """Handle timeouts, retries and polls; called at least ten times a second."""


class RegisterDevice(Protocol):
    """A device on a register bus (I2C)."""

    @property
    def period_s(self) -> float:
        """Wanted time between the starts of two cycles."""

    def configure(self) -> Program[Identity]:
        """Identify, reset, read calibration, set up. DeviceError when the device is not what it should be."""

    def cycle(self, stamp: Stamp) -> Program[Sequence[Stamped[Reading] | Rejected]]:
        """Run one measurement cycle; `stamp` is the host's time at its start."""
