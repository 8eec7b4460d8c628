"""A serial port against a pseudo terminal: arrival, waking, loss and return, and words for what cannot be opened."""

import errno
import os
import termios
import threading
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest
import serial

from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Send
from hindrax_core.events import Stamp, after
from hindrax_drivers.buses.clock import SystemClock
from hindrax_drivers.buses.line import SerialPort
from hindrax_drivers.buses.ports import open_clock


class Pty:
    """A pseudo terminal behind a stable name, that can be unplugged and plugged in again."""

    def __init__(self, link: Path) -> None:
        self.path = link
        self.plug()

    def plug(self) -> None:
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.path.symlink_to(os.ttyname(self._slave))

    def received(self, count: int) -> bytes:
        """What the host has sent; a pty passes bytes on in its own time."""
        data = b""
        while len(data) < count:
            data += os.read(self.master, 100)
        return data

    def unplug(self) -> None:
        self.path.unlink()
        os.close(self._slave)
        os.close(self.master)


@pytest.fixture
def pty(tmp_path: Path) -> Iterator[Pty]:
    one = Pty(tmp_path / "dvl")
    yield one
    one.unplug()


@pytest.fixture
def clock() -> Iterator[SystemClock]:
    one = SystemClock()
    yield one
    one.close()


def test_bytes_arrive_with_the_time_of_arrival(pty: Pty, clock: SystemClock) -> None:
    port = SerialPort(str(pty.path), 115200, clock)
    assert port.read()[0] == b""
    before = clock.now()
    os.write(pty.master, b"$DVPDL")
    port.wait(after(before, 10.0))
    data, stamp = port.read()
    assert data == b"$DVPDL"
    assert before <= stamp <= clock.now()
    port.close()


def test_no_byte_is_younger_than_its_stamp(pty: Pty) -> None:
    """However long the processor is with another program between the look at the clock and that at the port."""

    class Interrupted(SystemClock):
        def now(self) -> Stamp:
            stamp = super().now()
            os.write(pty.master, b"$")
            written.append(super().now())
            return stamp

    written: list[Stamp] = []
    clock = Interrupted()
    port = SerialPort(str(pty.path), 115200, clock)
    received = 0
    for _ in range(20):
        data, stamp = port.read()
        received += len(data)
        assert not received or written[received - 1] <= stamp
    assert received
    port.close()
    clock.close()


def test_the_line_has_the_wanted_speed(pty: Pty, clock: SystemClock) -> None:
    port = SerialPort(str(pty.path), 921600, clock)
    assert termios.tcgetattr(pty.master)[4] == termios.B921600
    port.close()
    port = SerialPort(str(pty.path), 115200, clock)
    assert termios.tcgetattr(pty.master)[4] == termios.B115200
    port.close()


def test_waiting_ends_with_bytes_with_time_and_with_a_wake(pty: Pty, clock: SystemClock) -> None:
    port = SerialPort(str(pty.path), 115200, clock)
    far = after(clock.now(), 60.0)
    threading.Timer(0.01, lambda: os.write(pty.master, b"x")).start()
    port.wait(far)
    assert port.read()[0] == b"x"
    port.wait(after(clock.now(), 0.01))
    assert port.read()[0] == b""
    threading.Timer(0.01, clock.wake).start()
    port.wait(far)
    assert clock.now() < far
    port.close()


def test_an_auto_baud_device_is_woken_before_the_bytes(pty: Pty, clock: SystemClock) -> None:
    port = SerialPort(str(pty.path), 115200, clock)
    port.send(Send(b"BR", wake=True))
    port.send(Send(b"!"))
    assert pty.received(4) == b"UBR!"
    port.close()


@pytest.mark.parametrize(("code", "lost"), [(errno.EOPNOTSUPP, False), (errno.EIO, True)])
def test_an_adapter_that_can_send_no_break_is_not_lost(
    pty: Pty, clock: SystemClock, monkeypatch: pytest.MonkeyPatch, code: int, *, lost: bool
) -> None:
    """Linux, drivers/usb/class/cdc-acm.c: acm_tty_break_ctl."""

    def refuse(_port: serial.Serial) -> None:
        raise OSError(code, os.strerror(code))

    port = SerialPort(str(pty.path), 115200, clock)
    monkeypatch.setattr(serial.Serial, "_update_break_state", refuse)
    if lost:
        with pytest.raises(DeviceError, match=r"dvl: lost .*check cable and power"):
            port.send(Send(b"BR", wake=True))
    else:
        port.send(Send(b"BR", wake=True))
        assert pty.received(3) == b"UBR"
    port.close()


def test_a_lost_port_is_a_device_error_and_can_be_opened_again(pty: Pty, clock: SystemClock) -> None:
    port = SerialPort(str(pty.path), 115200, clock)
    pty.unplug()
    with pytest.raises(DeviceError, match=r"dvl: lost .*check cable and power"):
        port.read()
    for attempt in (port.read, lambda: port.send(Send(b"x")), lambda: port.wait(clock.now())):
        with pytest.raises(DeviceError):
            attempt()
    with pytest.raises(DeviceError):
        SerialPort(str(pty.path), 115200, clock)
    pty.plug()
    port = SerialPort(str(pty.path), 115200, clock)
    os.write(pty.master, b"back")
    port.wait(after(clock.now(), 10.0))
    assert port.read()[0] == b"back"
    port.close()


def test_a_port_is_held_by_one_program(pty: Pty, clock: SystemClock) -> None:
    port = SerialPort(str(pty.path), 115200, clock)
    with pytest.raises(DeviceError, match="busy; another program has it open"):
        SerialPort(str(pty.path), 115200, clock)
    port.close()
    SerialPort(str(pty.path), 115200, clock).close()


@pytest.mark.parametrize(
    ("path", "words"),
    [("/dev/nope", "no such port"), ("/tmp", "not a serial port but a directory"), ("/dev/null", "not a serial port")],
)
def test_what_cannot_be_opened_is_explained(path: str, words: str, clock: SystemClock) -> None:
    with pytest.raises(DeviceError, match=rf"{path}: {words}.*hindrax doctor"):
        SerialPort(path, 115200, clock)


def test_a_real_port_lives_in_system_time() -> None:
    clock = open_clock("/dev/hindrax/dvl")
    assert isinstance(clock, SystemClock)
    clock.sleep_until(after(clock.now(), -5.0))  # long past: no sleep
    clock.wake()
    clock.wake()
    clock.sleep_until(after(clock.now(), 60.0))  # woken beforehand: no sleep
    clock.close()
