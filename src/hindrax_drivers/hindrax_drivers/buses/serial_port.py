"""A serial port, 8N1: bytes with their arrival time, clear errors when it cannot be opened or is lost."""

from __future__ import annotations

import contextlib
import errno
import time

import serial

from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Send
from hindrax_core.events import Stamp
from hindrax_drivers.buses.clock import Clock, Meanwhile, nothing

BREAK_S = 0.001
WRITE_TIMEOUT_S = 1.0
AUTO_BAUD = b"U"  # 0x55: alternating bits, from which a device measures the line speed

_REMEDY = {
    errno.ENOENT: "no such port; check cable and power, and the udev rule that makes this name",
    errno.EACCES: "not allowed; add the user to the group dialout (sudo usermod -aG dialout $USER) and log in again",
    errno.EPERM: "not allowed; add the user to the group dialout (sudo usermod -aG dialout $USER) and log in again",
    errno.EAGAIN: "busy; another program has it open (find it with `fuser`)",
    errno.EBUSY: "busy; another program has it open (find it with `fuser`)",
    errno.ENOTTY: "not a serial port; check the port in the vehicle file",
    errno.EISDIR: "not a serial port but a directory; check the port in the vehicle file",
}


class SerialPort:
    """An open port, exclusive where the system supports that. DeviceError when it is lost: then open it anew."""

    def __init__(self, path: str, baud: int, clock: Clock) -> None:
        self._path, self._clock = path, clock
        self._port = _open(path, baud)

    def read(self) -> tuple[bytes, Stamp]:
        """Return the bytes that have arrived, without waiting, and the time of the read."""
        stamp = self._clock.now()
        try:
            return bytes(self._port.read(65536)), stamp
        except (serial.SerialException, OSError, TypeError) as error:
            raise self._lost(error) from error

    def wait(self, until: Stamp, meanwhile: Meanwhile = nothing) -> None:
        """Sleep on the clock until bytes arrive, the time has come, or `clock.wake()` is called."""
        try:
            descriptor = self._port.fileno()
            self._clock.sleep_until(until, descriptor, meanwhile)
        except (serial.SerialException, OSError, ValueError) as error:
            raise self._lost(error) from error

    def send(self, order: Send) -> None:
        """Send bytes; with `wake`, after a BREAK of 1 ms, a pause of 1 ms and 'U' for auto-baud devices."""
        try:
            if order.wake:
                self._wake()
            self._port.write(order.data)
        except (serial.SerialException, OSError) as error:
            raise self._lost(error) from error

    def close(self) -> None:
        """Close the port; closing twice is no error."""
        with contextlib.suppress(serial.SerialException, OSError):
            self._port.close()

    def _wake(self) -> None:
        self._port.break_condition = True
        time.sleep(BREAK_S)
        self._port.break_condition = False
        time.sleep(BREAK_S)
        self._port.write(AUTO_BAUD)

    def _lost(self, error: Exception) -> DeviceError:
        self.close()
        return DeviceError(f"{self._path}: lost ({error}); check cable and power")


def _open(path: str, baud: int) -> serial.Serial:
    try:
        port = serial.Serial(path, baud, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True)
    except (serial.SerialException, OSError, ValueError) as error:
        remedy = _REMEDY.get(_code(error), f"cannot be opened ({error})")
        raise DeviceError(f"{path}: {remedy}; `./hindrax doctor` lists what is there") from error
    with contextlib.suppress(ValueError, OSError, NotImplementedError):
        port.set_low_latency_mode(True)  # FTDI adapters otherwise hold bytes back for 16 ms
    return port


def _code(error: Exception) -> int:
    """Errno of a failed opening; pyserial hides it in a chain of exceptions of its own, or in their text."""
    cause: BaseException | None = error
    while cause is not None:
        if cause.args and isinstance(cause.args[0], int):
            return cause.args[0]
        cause = cause.__context__
    return errno.EAGAIN if "exclusively lock" in str(error) else 0
