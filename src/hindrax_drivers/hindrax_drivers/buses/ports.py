"""Ports by their names in the vehicle file: a real bus or clock, or that of mock hardware."""

from hindrax_drivers.buses.clock import MOCK_PREFIX, Clock, RegisterBus, SystemClock
from hindrax_drivers.buses.gpio import GPIO_PREFIX, GpioBus
from hindrax_drivers.buses.i2cdev import Smbus2Bus
from hindrax_drivers.buses.mock_bus import VirtualBus, VirtualClock


def open_bus(port: str, name: str = "") -> RegisterBus:
    """Open a bus. DeviceError with the missing part and the remedy.

    Parameters
    ----------
    port
        "/dev/i2c-1" (Linux), "gpio:CHIP" or "mock:/path/to/socket" (mock hardware, always asked for by name).
    name
        Of the client, for the mock.

    Returns
    -------
    RegisterBus
        To be closed.
    """
    if port.startswith(MOCK_PREFIX):
        return VirtualBus(port.removeprefix(MOCK_PREFIX), name)
    if port.startswith(GPIO_PREFIX):
        return GpioBus(port.removeprefix(GPIO_PREFIX))
    return Smbus2Bus(port)


def open_clock(port: str, name: str = "") -> Clock:
    """Open the clock of a port.

    Parameters
    ----------
    port
        "system", or "mock:/path/to/socket" for the clock of mock hardware; any other one is real and uses system time.
    name
        Of the client, so that the mock can wake a serial node whose port gets bytes (`BusServer.wake`).

    Returns
    -------
    Clock
        To be closed.
    """
    if port.startswith(MOCK_PREFIX):
        return VirtualClock(port.removeprefix(MOCK_PREFIX), name)
    return SystemClock()
