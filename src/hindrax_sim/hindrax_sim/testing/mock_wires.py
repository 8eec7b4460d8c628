"""Emulated hardware that answers on a port, served by a thread beside the test."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from hindrax_core.bus_operations import Transaction
from hindrax_core.events import Stamp
from hindrax_sim.buses.mock_server import BusServer
from hindrax_sim.buses.serial_ends import Pty, UdpEnd
from hindrax_sim.devices.dvl75 import Dvl75
from hindrax_sim.devices.ping1d import Ping1d


@contextlib.contextmanager
def repeated(turn: Callable[[], object], pause_s: float = 0.0) -> Iterator[None]:
    """Call it over and over beside the test."""
    stop = threading.Event()

    def run() -> None:
        while not stop.is_set():
            turn()
            time.sleep(pause_s)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


@contextlib.contextmanager
def serial_device(end: Path | UdpEnd, device: Dvl75 | Ping1d) -> Iterator[None]:
    """Let a device answer on a pty, or on the network."""
    begun, port = time.monotonic(), end if isinstance(end, UdpEnd) else Pty(end)

    def turn() -> None:
        now_s = time.monotonic() - begun
        port.write(device.step(now_s) + device.receive(port.read(), now_s))

    with contextlib.closing(port), repeated(turn, 0.005):
        yield


@contextlib.contextmanager
def jumping_bus(path: Path, transfer: Callable[[Transaction, Stamp], bytes]) -> Iterator[str]:
    """Serve a bus whose time jumps from one wish of the tool to the next; its port is told."""
    now = Stamp(10**9)
    server = BusServer(str(path), transfer, now)

    def turn() -> None:
        nonlocal now
        server.serve(now, 0.001)
        if not server.busy() and server.earliest_wakeup() < 1 << 62:
            now = max(now, server.earliest_wakeup())

    with contextlib.closing(server), repeated(turn):
        yield f"mock:{path}"
