"""The mock vehicle as other programs see it: ptys, the socket of the bus, and time that follows whoever uses them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol, Self

from hindrax_core.bus import Transaction
from hindrax_core.events import Stamp, stamp_from_s, to_s
from hindrax_core.vehicle import Vehicle
from hindrax_sim.buses.fuse_i2c import FuseI2c
from hindrax_sim.buses.server import BusServer
from hindrax_sim.buses.wall_time import WallTime
from hindrax_sim.faults import FaultSpec
from hindrax_sim.governor import Governor
from hindrax_sim.hardware import THRUSTERS, Hardware, STEP_ns, STEP_s
from hindrax_sim.ptys import Pty
from hindrax_sim.world import Conditions

MADE_UP_S = 0.1
PATIENCE_S = 0.1
"""Wall time for which a client that is awake may hold up time: one that hangs must not stop the world."""


class Wired(Protocol):
    """What stands behind the ports: serial devices by name, a bus, and time that is let pass."""

    vehicle: Vehicle
    i2c: Any
    serial: Any
    registers: Any

    @property
    def stamp(self) -> Stamp:
        """Its time."""

    def advance(self, stamp: Stamp) -> dict[str, bytes]:
        """Let time pass; returns what each serial device has put on its wire."""


class Ports:
    """Hardware behind ports in a folder; `step` lets 5 ms pass at most. Use it as a context manager."""

    def __init__(self, hardware: Wired, folder: Path, *, rate: float) -> None:
        self.hardware = hardware
        self.governor = Governor(rate)
        self._ptys = {name: Pty(folder / name) for name in self.hardware.serial}
        self._socket = folder / "i2c"
        self._server = BusServer(str(self._socket), self._transfer, self.hardware.stamp)
        self.last_write: Stamp | None = None
        """Time of the mock at which a control loop that lives by this clock was heard last."""
        self._step_began = time.monotonic()
        self.faces: list[Callable[[Stamp], None]] = []
        """Called with the time after every step."""

    def __enter__(self) -> Self:
        """Nothing to open: the ports are there when it is made."""
        return self

    def __exit__(self, *_: object) -> None:
        """Unplug everything."""
        self._server.close()
        for one in self._ptys.values():
            one.close()

    @property
    def ports(self) -> dict[str, str]:
        """Port of every device, and of the thruster output, by name."""
        bus = f"mock:{self._socket}"
        found = {name: str(one.path) for name, one in self._ptys.items()}
        return {THRUSTERS: bus} | dict.fromkeys(self.hardware.registers, bus) | found

    @property
    def clock(self) -> str:
        """Where the clock of the mock is read and waited for."""
        return f"mock:{self._socket}"

    def step(self) -> None:
        """Let one step of time pass, then let the clients work; wait as the governor says."""
        now = self._next()
        said = self.hardware.advance(now)
        # The time is shown before the bytes are there: who reads them stamps their arrival with it.
        self._server.serve(now)
        for name, data in said.items():
            self._exchange(name, data, to_s(now))
        self._attend(now)
        self._wait(now)
        for face in self.faces:
            face(now)

    def hold(self, seconds: float) -> list[str]:
        """Let clients work while time stands still; returns who is there."""
        self._server.serve(self.hardware.stamp, seconds)
        return self._server.clients()

    def _next(self) -> Stamp:
        return Stamp(self.hardware.stamp + STEP_ns)

    def offer_file(self, path: str) -> FuseI2c:
        """Show the bus also as a file that answers the ioctls of Linux, for programs of others; root only.

        Whoever asks for it closes it, before the mock.
        """
        file = FuseI2c(path, self.hardware.i2c.transfer, WallTime(lambda: self.hardware.stamp).now)
        self._server.also(file.fileno(), file.serve)
        return file

    def _exchange(self, name: str, data: bytes, now_s: float) -> None:
        """Put bytes on the wire of a device, and take what the host sent."""
        port = self._ptys[name]
        port.plug(in_place=getattr(self.hardware.serial[name], "connected", True))
        sent = port.take()
        if sent and name == THRUSTERS and self._server.clients():
            # Without a client of the clock it is a program of others, which writes when it pleases.
            self.last_write = self.hardware.stamp
        if sent:
            data += self.hardware.serial[name].receive(sent, now_s)
        if data:
            port.put(data)
            self._server.rouse(name)

    def _attend(self, now: Stamp) -> None:
        """Time stands still while a client works, for as long as patience lasts."""
        deadline = time.monotonic() + PATIENCE_S
        while self._server.busy() and time.monotonic() < deadline:
            self._server.serve(now, 0.005)

    def _wait(self, now: Stamp) -> None:
        """Serve until the governor lets the step end."""
        while (least := self.governor.least_wall_s(STEP_s, now, self.last_write)) > 0.0:
            left = self._step_began + least - time.monotonic()
            if left <= 0.0:
                break
            self._server.serve(now, min(left, 0.002))
        # Where time goes by the wall clock, a step that was late is made up for: who sleeps by it must not drift.
        due = self._step_began + least if 0.0 < least <= STEP_s else time.monotonic()
        self._step_began = max(due, time.monotonic() - MADE_UP_S)

    def _transfer(self, transaction: Transaction, now: Stamp) -> bytes:
        answer: bytes = self.hardware.i2c.transfer(transaction, now)
        if transaction.address == self.hardware.vehicle.output.address:
            self.last_write = now
        return answer


class Mock(Ports):
    """The mock vehicle behind ports."""

    hardware: Hardware

    def __init__(
        self,
        vehicle: Vehicle,
        folder: Path,
        *,
        seed: int,
        rate: float,
        conditions: Conditions | None = None,
        faults: Sequence[FaultSpec] = (),
    ) -> None:
        super().__init__(Hardware(vehicle, seed, conditions, faults), folder, rate=rate)


def run_for(mock: Mock, seconds: float) -> None:
    """Let time pass without anybody else: for tests and warm-up."""
    end = Stamp(mock.hardware.stamp + stamp_from_s(seconds))
    while mock.hardware.stamp < end:
        mock.step()
