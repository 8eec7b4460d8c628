"""The thread of a serial port against a pseudo terminal: what is asked from another thread goes out on its own."""

import os
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path

from hindrax_core.driver_interface import Output, Send, Trouble
from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import DeviceText
from hindrax_drivers.buses.clock import SystemClock
from hindrax_drivers.buses.port_threads import SerialThread

PATIENT_S = 20.0


class Parrot:
    """Says hello when it is plugged in, and reads what it hears as text."""

    baud = 115200
    ready = True

    def start(self, stamp: Stamp) -> list[Output]:
        del stamp
        return [Send(b"hello")]

    def feed(self, data: bytes, stamp: Stamp) -> list[Output]:
        return [Stamped(stamp, DeviceText(data.decode()))]

    def tick(self, stamp: Stamp) -> list[Output]:
        del stamp
        return []


def until(done: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENT_S
    while not done():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def received(master: int, wanted: bytes) -> bool:
    data = b""
    while len(data) < len(wanted):
        data += os.read(master, 100)
    return data == wanted


def test_it_greets_listens_asks_what_others_want_asked_and_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "port"
    master, slave = os.openpty()
    tty.setraw(slave)
    path.symlink_to(os.ttyname(slave))
    outputs: list[Output] = []
    asked_on: list[str] = []
    passed: list[tuple[bool, bytes]] = []
    thread = SerialThread(
        str(path), Parrot(), SystemClock(), outputs.extend, lambda _, sent, data: passed.append((sent, data))
    )

    def question() -> list[Output]:
        asked_on.append(threading.current_thread().name)
        return [Send(b"profile?")]

    thread.start()
    assert received(master, b"hello")
    os.write(master, b"polly")
    until(lambda: any(isinstance(one, Stamped) for one in outputs))
    thread.call(question)
    assert received(master, b"profile?")
    assert asked_on == [str(path)]
    path.unlink()
    os.close(slave)
    os.close(master)
    until(lambda: any(isinstance(one, Trouble) for one in outputs))
    assert not thread.ready
    master, slave = os.openpty()
    tty.setraw(slave)
    path.symlink_to(os.ttyname(slave))
    assert received(master, b"hello")
    thread.stop()
    assert passed[:2] == [(True, b""), (True, b"hello")]
    assert (False, b"polly") in passed
    assert thread.failure is None
    os.close(slave)
    os.close(master)
