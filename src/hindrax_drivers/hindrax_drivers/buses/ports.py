"""Ports by their names in the vehicle file: a real bus or clock, or that of mock hardware."""

from hindrax_drivers.buses.clock import MOCK_PREFIX, Clock, RegisterBus, SystemClock
from hindrax_drivers.buses.gpio import GPIO_PREFIX, GpioBus
from hindrax_drivers.buses.i2cdev import Smbus2Bus
from hindrax_drivers.buses.mock_bus import VirtualBus, VirtualClock


def open_bus(port: str, name: str = "") -> RegisterBus:
    """Open "/dev/i2c-1" (Linux), "gpio:CHIP" or "mock:/path/to/socket" (mock hardware, always asked for by name).

    DeviceError with the missing part and the remedy.
    """
    if port.startswith(MOCK_PREFIX):
        return VirtualBus(port.removeprefix(MOCK_PREFIX), name)
    if port.startswith(GPIO_PREFIX):
        return GpioBus(port.removeprefix(GPIO_PREFIX))
    return Smbus2Bus(port)


def open_clock(port: str, name: str = "") -> Clock:
    """Open "system", or "mock:/path/to/socket" for the clock of mock hardware.

    `name` identifies the client to the mock, so that it can wake a serial node whose port gets bytes
    (`BusServer.wake`). Any other port is real and uses system time.
    """
    if port.startswith(MOCK_PREFIX):
        return VirtualClock(port.removeprefix(MOCK_PREFIX), name)
    return SystemClock()
